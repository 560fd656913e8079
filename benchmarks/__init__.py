"""Measurements against something a user could pick instead; scenes shared with the tests."""
