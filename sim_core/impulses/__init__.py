"""Velocity changes at contacts and by the air."""
