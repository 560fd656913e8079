"""What a design file and a study file contain, and how they are loaded."""
