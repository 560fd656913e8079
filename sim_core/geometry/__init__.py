"""What balls can hit: meshes, analytical cavities, obstacles and their tree."""
