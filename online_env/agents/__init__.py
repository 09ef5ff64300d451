"""Agents: what one is, all of them by name, and those that come with the library."""
