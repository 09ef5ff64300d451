"""Work across two or three applications."""
