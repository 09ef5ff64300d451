"""`hijack view`: a local page to look through the rows of a dataset, or the episodes of a run.

Each kind of folder has an adapter (`datasets.py`, `runs.py`) with the attributes and methods of
`source.Source`; `index.py` filters and counts, `answers.py` says what the page asks for,
`server.py` speaks HTTP.
"""

from .opening import open_source
from .server import ViewServer, serve

__all__ = ["ViewServer", "open_source", "serve"]
