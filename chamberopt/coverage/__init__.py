"""The way from impacts to dents, coverage, and metrics with intervals."""
