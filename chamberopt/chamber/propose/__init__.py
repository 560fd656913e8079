"""Propose a first design for a part: target, pose, balls and chamber, each with its reason."""
