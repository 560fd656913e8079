"""Measure coverage over the target: the covered share of windows of a stated area, the gauge."""
