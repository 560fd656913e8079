"""The simulated scene: cavity, balls, effects, packing, and checks that refuse bad scenes."""
