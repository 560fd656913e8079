"""What a ball can hit."""
