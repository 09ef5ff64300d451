"""Readers of results: one file a format; `outcome_formats.READERS` names them."""
