"""Where the search looks next: Sobol points, NLopt, and a Gaussian process."""
