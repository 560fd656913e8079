"""Compare candidates: their figures, and their coverage at each place of the target."""
