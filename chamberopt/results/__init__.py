"""Write results folders, read them, compare them, and simulate the replicas of a result again."""
