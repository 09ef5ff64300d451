"""Corrupting a running desktop by hand: a command, and the buttons of the desktop's page."""
