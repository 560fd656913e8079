"""The commands that simulate a replica of a result again, to show what it does."""
