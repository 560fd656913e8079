"""Further effects of a hit on a surface, one a file, in the order of surface_effects.py."""
