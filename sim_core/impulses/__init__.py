"""Velocity changes of balls when they hit a surface or another ball, and by air drag."""
