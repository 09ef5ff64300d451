"""Commands, in the terminal."""
