"""Files for other programs: impacts, fields on the part's mesh, the chamber, a study's table."""
