"""Compare candidates: their figures, and their coverage at each point of the target."""
