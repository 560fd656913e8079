"""Results folders: written, and read back."""
