"""Pictures drawn with matplotlib: studies, sweeps, accuracy, coverage of one or more results."""
