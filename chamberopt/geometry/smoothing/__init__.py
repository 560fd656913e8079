"""Find the smooth surface behind a part's triangles: its rounds, its normals and a finer mesh."""
