"""A dataset on the disk: its files, columns, pictures and card, and how to open it."""

from .opening import Dataset, open_dataset

__all__ = ["Dataset", "open_dataset"]
