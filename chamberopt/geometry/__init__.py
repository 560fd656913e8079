"""Triangles, solids and mesh files. This package knows nothing about shot or designs."""
