"""Files and folders, in the file manager."""
