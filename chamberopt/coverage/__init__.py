"""From impacts to dents, from dents to coverage, from coverage to metrics with intervals."""
