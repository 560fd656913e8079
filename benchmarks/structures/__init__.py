"""Spatial structures that the product does not use, kept to be measured against the one it does; one idea a file.

Structures over a mesh offer ``build(shell)`` and a search for a ball's next arc: delay [s] and obstacle of the first
contact. They hold the same obstacles and run the same exact tests, so that only the search differs.
"""
