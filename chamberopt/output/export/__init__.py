"""What other programs read: impacts, fields on the part's mesh, the chamber, a study's table. One kind a file."""
