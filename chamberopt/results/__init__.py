"""Write results folders, read them back, compare them, and simulate their replicas again."""
