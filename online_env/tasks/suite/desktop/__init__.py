"""Settings of the desktop itself."""
