"""The commands in the trade's terms, one file each."""
