"""What is said of a design before anything runs."""
