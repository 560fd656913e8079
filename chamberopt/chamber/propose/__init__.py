"""A first design for a part: its target, pose, balls, chamber and charge, each with its reason."""
