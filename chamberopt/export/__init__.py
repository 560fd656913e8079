"""Results in the formats of other programs, in the numbers of the part's own file."""
