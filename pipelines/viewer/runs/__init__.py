"""Runs for the viewer: of `hijack bench` or `hijack score`, or the log of a `CorruptedEnv`.

`run_source.py` opens a folder. `listing.py` reads one light entry for each episode
(`episode_entry.py`), `listing_index.py` keeps those of a large run for the next time, and
`entry_columns.py` arranges them for the page. `episode.py` reads one episode with its steps,
`model_requests.py` the requests to models in it, `action_strokes.py` computes what to draw for an
action, `scored_rows.py` finds the rows of a scoring run in their dataset, and `export.py` writes
selected episodes to one file.
"""

from .run_source import RunSource

__all__ = ["RunSource"]
