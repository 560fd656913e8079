"""Text of the site that is made from the program: the keys of its files, and its commands."""
