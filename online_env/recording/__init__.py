"""Recordings of a real desktop: the pictures that offline corruptions paste (the asset pack), and trajectories."""
