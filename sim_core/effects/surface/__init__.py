"""Effects of a hit on a surface besides restitution and friction, each in its own file.

surface_effects.py says in which order they act.
"""
