"""Engines make the shards of a build, here or elsewhere; all engines make the same files.

`pipelines.building.engine_registry` defines what an engine is, and names the modules of this folder
without importing them: they need `building`, not the reverse.
"""

from ..building.engine_registry import ENGINES, LOCAL, RAY, Engine, Tick, get_engine, register

__all__ = ["ENGINES", "LOCAL", "RAY", "Engine", "Tick", "get_engine", "register"]
