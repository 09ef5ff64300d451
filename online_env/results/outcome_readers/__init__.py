"""Readers of results: one file a format; `outcomes.READERS` names them."""
