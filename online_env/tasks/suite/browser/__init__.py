"""Settings, bookmarks and the history of the browser itself."""
