"""Plain text, in an editor."""
