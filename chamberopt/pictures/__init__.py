"""Pictures and films of the part in its chamber, drawn with pyvista."""
