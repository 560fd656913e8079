"""The commands that begin a design, one file each."""
