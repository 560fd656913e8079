"""Work with triangles, solids and mesh files. Nothing here knows about shot or chambers."""
