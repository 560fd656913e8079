"""Strips, calibration and tolerances: a simulated design in the terms of a peening shop."""
