"""Benchmarks as tasks of Inspect AI: `inspect eval agenthijack/embedded_small --model ...`.

Inspect finds the tasks by the entry point `agenthijack` of the group `inspect_ai`. A sample is an
episode: a task, a corruption and a seed. It has a desktop of its own, which `sessions` starts and
ends; `tool` is the computer, `scoring` the score, `tasks` puts them together.
"""

from hijack_data import extras

EXTRA = "inspect"
extras.require("a benchmark in Inspect", EXTRA, ["inspect_ai"])
