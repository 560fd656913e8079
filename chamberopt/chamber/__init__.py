"""The closed cavity of a design, and the simulator's scene in the cavity."""
