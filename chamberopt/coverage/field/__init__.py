"""Measure coverage in windows: discs of the target whose area, the gauge, the design gives."""
