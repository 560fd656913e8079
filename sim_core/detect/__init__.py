"""Search for the time at which a ball first touches an obstacle or another ball."""
