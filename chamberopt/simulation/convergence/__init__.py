"""What accuracy costs: knobs, the ladder that tries them, and what follows from it."""
