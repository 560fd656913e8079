"""Physical effects that a scene can have, such as gravity, each with its source and formula.

An effect that is None is absent: numba removes its branches by type, so that it takes neither
memory nor machine code.
"""
