"""Presentations, in LibreOffice Impress."""
