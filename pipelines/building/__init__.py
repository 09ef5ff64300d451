"""Building datasets: from recorded trajectories to a folder of Parquet shards."""

from .build import build
from .build_report import BuildReport

__all__ = ["BuildReport", "build"]
