"""The proof that the augmentation helps: a small network learns to click on a labelled control.

`browser` drives Chromium, `markup` writes seeded pages, `pages` renders them and the local web
sites into a folder, `data` makes batches of them, `model` is the network, `train` trains and
evaluates it, `score` gives the intervals. `python benchmarks/proof.py` runs it all; `docs/proof.md`
says how it was set up.
"""
