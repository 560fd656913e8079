"""Take a design to a saved result in one call. Nothing here prints on the terminal."""
