"""Published cases that the simulator is held against; benchmarks/validation.py runs them."""
