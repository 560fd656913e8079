"""Write files for other programs: impacts, values on the part's mesh, the chamber, study tables."""
