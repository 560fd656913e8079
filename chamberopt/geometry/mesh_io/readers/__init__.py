"""One reader for each family of part file formats."""
