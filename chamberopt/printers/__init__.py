"""Turn documents into HTML pages, into a printed sheet and into JSON values."""
