"""Contact mode: balls that slide, roll or lie still on surfaces and on one another."""
