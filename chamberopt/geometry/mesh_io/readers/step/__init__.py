"""STEP files: their unit, bodies, names and colours, and a mesh of their faces."""
