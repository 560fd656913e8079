"""Objects that balls can hit: meshes, analytical cavities, obstacles and their tree."""
