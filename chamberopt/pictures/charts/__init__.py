"""Charts of studies, sweeps, accuracy and coverage, drawn with matplotlib."""
