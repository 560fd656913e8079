"""Triangles, solids and mesh files; nothing in this package knows about shot or designs."""
