# On a bare machine with Python and make: `make demo` shows a first result, `make test` runs the tests.
# Each target sets up what it needs, once; `make PYTHON=python3.12 demo` chooses the interpreter.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= demo
PACKAGES := calib silhouette_core voxelpose
# Processes that share the tests out among themselves, one core each.
WORKERS ?= 2
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Many containers set it; then each of the hundred processes that tests begin compiles all modules anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help install demo test test-fast browser network tour check lint docs format bench accuracy trials kills mutants fuzz proposal clean

help:
	@echo "make demo      makes a small recording, fits it and leaves the folder $(OUT)/ worth looking at"
	@echo "make test      runs all tests (make test-fast leaves out the slow ones), in 2 processes: make WORKERS=8 test"
	@echo "make browser   gets a Chromium for the tests of viewer and report, which are skipped without one"
	@echo "make network   gets the pose network for the tests with it, which are skipped without one"
	@echo "make check     style, types, layers, lines of packages and pages, and the documentation built without a warning"
	@echo "make docs      the user guide and the reference as pages: open site/index.html"
	@echo "make bench     speed, each case against a reference in the same run"
	@echo "make accuracy  scores estimates on rendered recordings, and on shared ones (VOXELPOSE_SHARED=folder, by default ../shared)"
	@echo "make trials    fits random recordings and writes their tables into out/trials/tables.md (an hour)"
	@echo "make tour      clicks through the studio from cameras and a board to exported motion (two minutes)"
	@echo "make kills     ends commands at random moments and looks for what is lost or left (half an hour)"
	@echo "make mutants   makes small mistakes in a copy of the code, and tells which the tests do not notice (half an hour)"
	@echo "make fuzz      damages files of every format, 10,000 times each, and runs the readers on them (an hour)"
	@echo "make proposal  learns anew the proposal of poses that comes with the program, from ../shared (an hour)"
	@echo "make install   creates $(VENV) with everything, for work on the code"
	@echo "make format    puts the code into the project's style"

install: $(VENV)/.ready-dev

demo: $(VENV)/.ready
	$(BIN)/voxelpose demo --out $(OUT) --overwrite

test: $(VENV)/.ready-dev
	$(BIN)/python -m pytest -n $(WORKERS)

test-fast: $(VENV)/.ready-dev
	$(BIN)/python -m pytest -n $(WORKERS) -m "not (slow or accuracy)"

network: $(VENV)/.ready-dev
	$(BIN)/voxelpose network install

tour: browser
	$(BIN)/python -m pytest -m tour

browser: $(VENV)/.ready-dev
	$(BIN)/python -m tests.browsing

# What CI asks beside the tests; the two run side by side with --jobs=2.
check: lint docs

lint: $(VENV)/.ready-dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/basedpyright
	$(BIN)/lint-imports
	@for name in $(PACKAGES); do echo "$$name: $$(find $$name -name '*.py' | xargs cat | wc -l) lines"; done
	@echo "together: $$(find $(PACKAGES) -name '*.py' | xargs cat | wc -l) lines"
	@echo "pages: $$(find $(PACKAGES) -name '*.js' -o -name '*.css' -o -name '*.html' | xargs cat | wc -l) lines"

docs: $(VENV)/.ready-docs
	rm -rf docs/reference
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -c docs -d build/docs . site
	cp site/README.html site/index.html

format: $(VENV)/.ready-dev
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: $(VENV)/.ready-dev
	$(BIN)/python -m benchmarks

accuracy: $(VENV)/.ready-dev
	$(BIN)/python -m benchmarks.accuracy
	$(BIN)/python -m pytest -n $(WORKERS) -m accuracy

trials: $(VENV)/.ready-dev
	$(BIN)/python -m benchmarks.trials

kills: $(VENV)/.ready-dev
	$(BIN)/python -m benchmarks.kills

mutants: $(VENV)/.ready-dev
	$(BIN)/python -m benchmarks.mutants

fuzz: $(VENV)/.ready-dev
	$(BIN)/python -m benchmarks.fuzz --mutations 10000

proposal: $(VENV)/.ready-dev
	$(BIN)/python -m tools.proposal

clean:
	rm -rf $(VENV) build dist site docs/reference *.egg-info .pytest_cache .ruff_cache .hypothesis .import_linter_cache

# The environment of the system's own Python: no other tool needed.
$(BIN)/python:
	@command -v $(PYTHON) >/dev/null || { echo "voxelpose needs Python 3.11 or newer, and there is no '$(PYTHON)': install it, or say make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else "voxelpose needs Python 3.11 or newer, and $(PYTHON) is %d.%d: say make PYTHON=python3.12, for example" % v[:2])'
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { echo "$(PYTHON) cannot make virtual environments with pip in them. On Debian and Ubuntu: sudo apt install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

$(VENV)/.ready: pyproject.toml | $(BIN)/python
	@echo "Installing voxelpose into $(VENV) (about a minute the first time) ..."
	$(BIN)/python -m pip install --quiet --no-compile --editable .
	@touch $@

$(VENV)/.ready-dev: pyproject.toml | $(BIN)/python
	@echo "Installing voxelpose and its tools into $(VENV) (a minute or two the first time) ..."
	$(BIN)/python -m pip install --quiet --no-compile --editable '.[dev]'
	@touch $@ $(VENV)/.ready

$(VENV)/.ready-docs: pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --no-compile --editable '.[docs]'
	@touch $@ $(VENV)/.ready
