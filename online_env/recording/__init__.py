"""Recordings of a real desktop: the asset pack that offline corruptions paste, and trajectories."""
