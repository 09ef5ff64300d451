"""`hijack search` and `hijack mine`: where an agent does worst, and what brings it back."""
