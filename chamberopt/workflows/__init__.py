"""Workflows from a design to a saved result. They print nothing on the terminal."""
