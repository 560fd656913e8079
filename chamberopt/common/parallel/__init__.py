"""Where replicas and candidates run."""
