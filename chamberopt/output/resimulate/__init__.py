"""A stored result simulated again, for its single impacts and flights."""
