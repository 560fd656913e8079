"""What the trade adds to a design: Almen strips, zones with limits, tolerances, calibration."""
