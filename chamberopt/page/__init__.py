"""Serve a page in the browser that edits a design, starts simulations and shows results.

The page keeps no data of its own: all that is made on it is a file that the commands accept.
"""
