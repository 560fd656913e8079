"""Documents: the sentences, tables and charts about a result, in a file for each capability."""
