"""What is simulated: scene, physics, packing, and what is refused."""
