"""The isolation of an embedded desktop: namespaces, files, limits, network and the keeper."""
