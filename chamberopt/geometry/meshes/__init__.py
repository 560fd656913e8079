"""Read mesh files of parts and set-ups, close their surface, and find their named groups."""
