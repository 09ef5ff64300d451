"""Adapters for other trainers: our environments, corruptions and replay in TRL and in verl."""
