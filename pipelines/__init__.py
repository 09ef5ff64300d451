"""Pipelines: recorded trajectories in, datasets out.

>>> from pipelines import build, inspect_source, open_dataset, verify
"""

from .building.build import BuildReport, build
from .dataset.lazy_rows import render
from .dataset.opening import Dataset, open_dataset
from .inspection import Inspection, inspect_source
from .proof.verify import VerifyReport, verify

__all__ = [
    "BuildReport",
    "Dataset",
    "Inspection",
    "VerifyReport",
    "build",
    "inspect_source",
    "open_dataset",
    "render",
    "verify",
]
