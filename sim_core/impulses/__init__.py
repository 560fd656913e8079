"""WHAT CHANGES: velocities before and after a contact. Nothing here asks when."""
