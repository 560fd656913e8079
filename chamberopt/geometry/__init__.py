"""Triangles, solids and mesh files; nothing here knows of shot or of designs."""
