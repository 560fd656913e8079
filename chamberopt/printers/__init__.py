"""Printers: documents as an HTML page, a printed sheet and JSON values."""
