"""Workflows that compute a result and save it in one call. They print nothing on the terminal."""
