"""Calibrate the model to one machine, from what was measured on it."""
