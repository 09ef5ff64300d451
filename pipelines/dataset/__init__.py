"""A dataset on disk: its files, columns and pictures, and how to open it."""

from .opening import Dataset, open_dataset

__all__ = ["Dataset", "open_dataset"]
