"""Draw a chamber to scale with its dimensions, in sections and a plan, and its openings."""
