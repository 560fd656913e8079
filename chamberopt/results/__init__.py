"""Results folders: writing them and reading them back."""
