"""Trainers of others: our environments, corruptions and replay in TRL and in verl."""
