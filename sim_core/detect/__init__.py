"""When a ball meets something."""
