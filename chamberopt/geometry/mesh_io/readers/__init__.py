"""One reader for each mesh format; elements.py makes triangles of finite elements."""
