"""Simulate a design in independent replicas, and compute coverage and other figures from them."""
