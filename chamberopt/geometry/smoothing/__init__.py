"""Find the smooth surface behind a part's triangles: its rounds, its normals and a finer mesh.

A round is a curved surface, such as a fillet, that the file divides into plane facets.
"""
