"""The folder of a study while it runs, and how a stopped study is resumed."""
