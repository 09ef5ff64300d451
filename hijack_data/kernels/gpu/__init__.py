"""Kernels for torch pictures on a GPU: Triton, one launch for all pictures of a batch."""
