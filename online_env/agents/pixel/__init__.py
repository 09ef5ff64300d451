"""Agents without a model that see only pictures: they follow a plan in words, and use OCR."""
