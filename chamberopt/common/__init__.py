"""Tools that all packages use: errors, TOML fields, files, progress, estimates and workers."""
