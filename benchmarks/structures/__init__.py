"""Spatial structures that are measured against the one that the product uses; one idea a file.

Structures over a mesh offer ``build(shell)`` and a search for a ball's next arc, which gives the
delay [s] and the obstacle of the first contact. They hold the same obstacles and run the same exact
tests, so that only the search differs.
"""
