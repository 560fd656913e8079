"""Draw charts of studies, sweeps, accuracy and coverage with matplotlib."""
