"""The convergence study of `chamberopt accuracy`: what numerical accuracy costs, and what to set."""
