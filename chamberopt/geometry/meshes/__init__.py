"""Read mesh files of parts, close their surface, and find their named groups of triangles."""
