"""Tools of every package: errors, TOML fields and messages, file writing, progress, workers."""
