"""Trajectories recorded on a desktop, by an oracle or by a person."""
