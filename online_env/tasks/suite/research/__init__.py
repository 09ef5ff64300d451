"""Facts from an encyclopedia, a handbook, a newspaper and a search page."""
