"""Virtual Almen strips, calibration of a machine, and tolerances of a design's figures."""
