"""Forms of a web site."""
