"""The commands that simulate many candidates, one file each."""
