"""Recordings and films, in VLC."""
