"""Offline scoring: an agent's first action on recorded screens, clean and corrupted.

No desktop is needed. `rules` says what is right, `answers` reads what an agent said, `cases` lists
the rows of a dataset, `row_asker` puts them to an agent, `workers` runs agents in processes that
may die, `run` writes the folder of a run.
docs/offline_scoring.md has the definitions.
"""
