"""Checks of a design before anything runs."""
