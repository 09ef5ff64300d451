"""Pictures, in GIMP."""
