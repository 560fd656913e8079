"""Documents as a terminal, an HTML page, a printed sheet and CSV tables show them."""
