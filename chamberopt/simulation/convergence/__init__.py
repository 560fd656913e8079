"""Convergence study of `chamberopt accuracy`: the cost of accuracy, and what to set."""
