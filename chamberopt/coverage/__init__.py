"""Compute dents, coverage, and metrics with confidence intervals from the balls' impacts."""
