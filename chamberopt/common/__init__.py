"""What every package uses: errors, messages about TOML files, file writing, progress, workers."""
