"""What a command does from a design to a saved result, without words on the terminal."""
