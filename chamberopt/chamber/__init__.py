"""Build the closed cavity of a design, in which the balls fly, and the scene to simulate in it."""
