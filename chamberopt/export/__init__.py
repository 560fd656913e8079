"""Write files for other programs.

They hold impacts, values on the part's mesh, the chamber, or the table of a study.
"""
