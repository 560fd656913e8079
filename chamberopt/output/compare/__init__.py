"""Candidates side by side: `chamberopt compare`."""
