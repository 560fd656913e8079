"""Mesh files of parts and set-ups: read them, close their surface, find their groups."""
