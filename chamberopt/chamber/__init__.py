"""Build the closed cavity of a design, and the scene in it that the simulator runs."""
