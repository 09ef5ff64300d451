"""`hijack view`: a local page to look through the rows of a dataset, or the episodes of a run.

A dataset (`dataset_source.py`) has the attributes and methods of `source.ViewerSource`; `index.py`
filters and counts its rows, and `json_answers.py` makes the page's data. Runs are in `runs/`.
`routes.py` maps paths to answers, `server.py` speaks HTTP.
"""
