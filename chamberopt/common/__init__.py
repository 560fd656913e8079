"""Tools that all packages use: errors, TOML files, output files, progress, estimates, workers."""
