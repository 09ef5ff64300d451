# Four commands to know: `make demo`, `make desktop`, `make check` and `make test`. Each sets up what it needs in .venv,
# and no more than that: a demo has no torch and no JAX. A stamp in .venv says what is there.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# CONSTRAINTS=.ci/constraints.txt installs the versions that CI has; without it, the newest that pyproject.toml admits.
# uv installs in a third of pip's time: the one on PATH, or its wheel. Where it is missing or fails (it does not read pip's
# configuration), pip does the work.
CONSTRAIN := $(if $(CONSTRAINTS),-c $(CONSTRAINTS))
UV = $(or $(shell command -v uv),$(BIN)/uv)
INSTALL = install() { $(UV) pip install --quiet --python $(BIN)/python $(CONSTRAIN) "$$@" 2>/dev/null || \
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile $(CONSTRAIN) "$$@"; }; install
# The wheel of pip that comes with Python fetches uv as it is: unpacking and compiling it takes four seconds.
PIP_WHEEL = $(shell $(PYTHON) -c 'import ensurepip, pathlib, sysconfig; \
	places = sysconfig.get_config_var("WHEEL_PKG_DIR"), pathlib.Path(ensurepip.__file__).parent / "_bundled"; \
	print(next(wheel for place in places if place for wheel in pathlib.Path(place).glob("pip-*.whl")))' 2>/dev/null)
# A test waits for other processes a third of its time, so there are three tests for two cores.
WORKERS ?= $(shell $(PYTHON) -c 'import os; print(3 * (os.cpu_count() or 1) // 2)')
# --dist worksteal: each process keeps neighbouring tests, so what a file sets up is made once
TEST := $(BIN)/python -m pytest -q -n $(WORKERS) --dist worksteal
# Each process has a desktop, for the tests of a file after each other. They share a machine: some are tried again. Files begin
# in the order of tests/support/parts.py, and not by their number of tests: the longest have few.
TEST_LIVE := $(BIN)/python -m pytest -q tests/live -n 3 --dist loadfile --no-loadscope-reorder --reruns 2 --reruns-delay 2

# Where it is set, each of the hundreds of processes that the tests start compiles all modules again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help env light live demo desktop foreign check quick core test test-all tail lint bench golden stubs docs package clean

help:  ## Show this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 18

env: $(VENV)/.ready  ## Create .venv with everything in it (one or two minutes, once)
light: $(VENV)/.light
live: $(VENV)/.live

$(VENV)/.made:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "needs Python 3.11 or newer: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "needs venv: apt-get install -y python3-venv"; exit 2; }
	$(PYTHON) -m venv --without-pip $(VENV)
	@$(UV) --version >/dev/null 2>&1 || \
		$(BIN)/python $(PIP_WHEEL)/pip install --quiet --disable-pip-version-check --no-compile uv >/dev/null 2>&1 || true
	@$(UV) pip install --quiet --python $(BIN)/python pip 2>/dev/null || $(BIN)/python -m ensurepip >/dev/null
	@touch $@

$(VENV)/.light: pyproject.toml | $(VENV)/.made
	@$(INSTALL) -e '.[vision]' pyarrow isal  # hf without datasets: with it, pyarrow imports pandas
	@touch $@

$(VENV)/.live: pyproject.toml | $(VENV)/.light
	@$(INSTALL) -e '.[hf,vision,online]'
	@touch $@

$(VENV)/.ready: pyproject.toml | $(VENV)/.made
	@$(INSTALL) -e '.[all,dev]'
	@touch $@ $(VENV)/.light $(VENV)/.live

$(VENV)/.docs: pyproject.toml | $(VENV)/.light
	@$(INSTALL) -e '.[hf,vision,docs]'
	@touch $@

demo: light  ## Corrupt real screens, make a gallery and build a Hugging Face dataset (into ./demo)
	$(BIN)/hijack demo --out demo

desktop: live  ## A live desktop in your browser, on any Linux (IMAGE=file or URL, or MIRROR=a Debian archive, off Debian 12)
	$(BIN)/hijack desktop install $(if $(IMAGE),--image $(IMAGE)) $(if $(MIRROR),--mirror $(MIRROR))
	$(BIN)/hijack desktop view

foreign: env  ## Desktops on hosts that are no Debian 12 (IMAGE=file of an image; root, mmdebstrap; five to ten minutes)
	.ci/foreign_host $(IMAGE) $(SUITE)

check: env  ## Lint, types and the quick tests, for the daily loop (two to three minutes on two cores)
	@$(MAKE) --no-print-directory -j2 lint quick

quick: env
	$(TEST) -m 'not slow'

# The parts: tests/support/parts.py.
test: env  ## Lint, types, and the core of the suite: each promise once, all nine corruptions on a desktop
	@$(MAKE) --no-print-directory -j2 lint core  # the tests wait for other processes a third of their time
	$(TEST_LIVE) --part core

core: env
	$(TEST) --ignore tests/live --part core

test-all: env lint  ## Lint, types and the whole suite
	$(TEST) --ignore tests/live
	$(TEST_LIVE)

tail: env  ## A sixth of what only make test-all runs: make tail PART=tail-1 (to tail-6)
	$(TEST) --ignore tests/live --part $(PART)
	$(TEST_LIVE) --part $(PART)

lint: env
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo --no-cache
	$(BIN)/pyright

bench: env  ## Run the benchmarks and rewrite benchmarks/RESULTS.md
	$(BIN)/python benchmarks/run.py

golden: env  ## Write the golden hashes anew (only together with a new version of a corruption)
	AGENTHIJACK_UPDATE_GOLDEN=1 $(BIN)/python -m pytest -q tests/golden

stubs: env  ## Write the stub of the transforms anew (after a change of their parameters)
	PYTHONPATH=tests $(BIN)/python -m support.stubs

docs: $(VENV)/.docs  ## Make the site in build/site, from the pages in docs/ (no broken link, no picture by hand)
	$(BIN)/python docs/site/make.py

package: $(VENV)/.made  ## Build sdist and wheel, and try the wheel in empty environments
	.ci/package

clean:  ## Remove .venv and everything that was made
	rm -rf $(VENV) demo build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
