"""What many tasks need: words for seeds, applications, documents, settings, the state of sites."""
