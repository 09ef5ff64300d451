"""A run for the page: of `hijack bench` or `hijack score`, or the log of a `CorruptedEnv`.

`listing.py` reads one light entry for each episode, `source.py` opens a folder and answers about
it, `episode.py` reads one episode with its steps, `requests.py` what was asked of models in it,
`drawing.py` says what an action looks like on the picture, `scored.py` finds the rows of a scoring
run in their dataset, and `export.py` writes chosen episodes as one file.
"""

from .run_source import RunSource

__all__ = ["RunSource"]
