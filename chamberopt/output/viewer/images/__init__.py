"""Images and films that are drawn without a window."""
