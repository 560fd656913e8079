"""Geometry that several chamber shapes share."""
