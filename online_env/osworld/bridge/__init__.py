"""The part that runs inside OSWorld's own environment, under that environment's Python.

It imports nothing of ours outside this folder: the two environments pin different versions of the
same packages.
"""
