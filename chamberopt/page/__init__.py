"""Serve a page in the browser that edits a design and shows its part, runs and results.

It keeps nothing of its own: each thing done on it is a file that the commands accept.
"""
