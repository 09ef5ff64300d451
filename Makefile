# Four commands to know: `make demo`, `make desktop`, `make check` and `make test`. Each sets up what it needs in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: help env demo desktop check test lint bench golden clean

help:  ## Show this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1\t/' | expand -t 18

env: $(VENV)/.ready  ## Create .venv with everything in it (about two minutes, once)

$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "needs Python 3.11 or newer: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "needs venv: apt-get install -y python3-venv"; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[all,dev]'
	@touch $@

demo: env  ## Corrupt real screens, make a gallery and build a Hugging Face dataset (into ./demo)
	$(BIN)/python examples/demo.py --out demo

desktop: env  ## A live desktop in your browser (Debian; installs its packages, once: root or sudo)
	$(BIN)/hijack desktop install
	$(BIN)/hijack desktop view

check: env lint  ## Lint, types and the quick tests, for the daily loop (under three minutes)
	$(BIN)/python -m pytest -q -n auto -m 'not slow'

test: env lint  ## Lint, check the types and run the whole suite
	$(BIN)/python -m pytest -q -n auto --ignore tests/live
	$(BIN)/python -m pytest -q tests/live -n 2 --dist loadfile --reruns 2 --reruns-delay 2  # real desktops on a shared machine

lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

bench: env  ## Run the benchmarks and rewrite benchmarks/RESULTS.md
	$(BIN)/python benchmarks/run.py

golden: env  ## Write the golden hashes anew (only together with a new version of a corruption)
	AGENTHIJACK_UPDATE_GOLDEN=1 $(BIN)/python -m pytest -q tests/golden

clean:  ## Remove .venv and everything that was made
	rm -rf $(VENV) demo build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
