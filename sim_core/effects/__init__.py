"""Effects of a scene, one a file: source, formula, and the neutral result when absent.

Absent means None: numba removes the branch by its type, so that an absent effect is in neither
memory nor machine code.
"""
