"""What every package uses: errors, TOML fields and messages, file writing, progress, workers."""
