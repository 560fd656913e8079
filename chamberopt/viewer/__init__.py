"""The window of `chamberopt inspect`."""
