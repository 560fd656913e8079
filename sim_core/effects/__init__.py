"""One effect a file: its source, its numbers, its formula, and the neutral answer when it is absent.

Absent means ``None``: numba prunes the branch on the type, so an absent effect is in neither memory nor machine
code.
"""
