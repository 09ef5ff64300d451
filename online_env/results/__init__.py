"""The results of runs: the folder of a run, its records, and what is computed from them.

`records` writes a folder and `reading` reads it, `origin` says where it was made, `scores`
computes one row for each agent and corruption, `statistics` and `intervals` what can be inferred
from them, `costs` what the models cost, `parts` what a scoring run has in addition.

`bench` and `scoring` write results, `report` shows them: `results` imports none of the three.
`report` imports `results` alone, `bench` both, and `scoring` all of them.
"""
