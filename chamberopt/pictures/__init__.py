"""Draw pictures and films of the part in its chamber with pyvista."""
