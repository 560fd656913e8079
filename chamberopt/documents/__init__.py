"""What is said of a result: its sentences, tables and charts, one file for each capability."""
