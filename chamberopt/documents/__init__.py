"""Write what is said of a result: sentences, tables and charts, in a file for each subject."""
