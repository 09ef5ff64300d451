"""A container that is itself a desktop: process 1 of it, without namespaces of its own."""
