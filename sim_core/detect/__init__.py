"""WHEN: the first time two things touch, approaching each other. Nothing here changes anything."""
