"""Choose the next point of a search: by Sobol points, NLopt, and a Gaussian process."""
