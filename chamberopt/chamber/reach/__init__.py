"""What a ball can touch in a cavity."""
