"""The sites, one file each: `HOST`, its name, and `make(sites)`, its application."""
