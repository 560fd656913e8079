"""Diagrams drawn with matplotlib."""
