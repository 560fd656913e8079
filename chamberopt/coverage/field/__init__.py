"""Coverage as a field over the target: shares of windows of a stated area, the gauge."""
