"""Search for the time at which a ball meets an obstacle or another ball."""
