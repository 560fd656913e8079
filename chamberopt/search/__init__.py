"""Search for a better design: study files, search algorithms, trial logs and results."""
