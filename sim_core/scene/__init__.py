"""What is simulated: the scene, its effects, packing, and what is refused."""
