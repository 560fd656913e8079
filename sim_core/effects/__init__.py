"""Effects of a scene, each in its own file with source, formula and the result without the effect.

An effect that is None is absent: numba removes its branches by type, so that it takes neither
memory nor machine code.
"""
