"""Simulate a design in independent replicas, and compute its figures with intervals from them."""
