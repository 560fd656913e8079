"""Compose texts on a result: sentences, tables and charts, with a file for each subject."""
