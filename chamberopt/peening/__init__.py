"""What a shop asks of a simulated design beyond its figures: strips, calibration, tolerances."""
