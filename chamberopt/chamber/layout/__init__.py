"""Lay out a part in a chamber by rules: its target, pose, balls, sonotrode, and what holds it."""
