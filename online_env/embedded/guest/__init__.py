"""The server inside a desktop: OSWorld's HTTP protocol and a few faster routes of our own."""
