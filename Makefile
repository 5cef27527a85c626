# The same verbs on a laptop and in CI: make setup check test golden bench docs demo serve
SHELL := /bin/bash
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
BENCH_STAMP := $(VENV)/.bench-installed
UV := $(shell uv --version >/dev/null 2>&1 && echo uv)
OUT ?= out/demo
PORT ?= 8000
# uv installs into a given interpreter; plain pip is called by the interpreter itself.
INSTALL = $(if $(UV),uv pip install -q --python $(BIN)/python,$(BIN)/python -m pip install -q --disable-pip-version-check)

.PHONY: setup check types test test-slow golden bench docs demo serve lock clean

setup: $(STAMP)

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; try make PYTHON=python3.12 setup"; exit 1; }
	$(if $(UV),uv venv -q --python $(PYTHON) $(VENV),$(PYTHON) -m venv $(VENV))

$(STAMP): requirements.lock pyproject.toml | $(BIN)/python
	$(INSTALL) --no-deps -r requirements.lock
	$(INSTALL) --no-deps -e .
	$(BIN)/zonemill warm
	@touch $@

$(BENCH_STAMP): requirements-bench.lock $(STAMP)
	$(INSTALL) --no-deps -r requirements-bench.lock
	@touch $@

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/unit/test_docstrings.py tests/unit/test_dependencies.py

test: $(STAMP)
	$(BIN)/python -m pytest -q -m "not slow" -n 2 --dist worksteal

test-slow: $(STAMP)
	$(BIN)/python -m pytest -q -m slow

# Rewrites the expected files; the diff is what gets reviewed.
golden: $(STAMP)
	ZONEMILL_GOLDEN=1 $(BIN)/python -m pytest -q $$(grep -rl assert_golden tests --include='test_*.py')
	git --no-pager diff --stat -- tests/golden

bench: $(BENCH_STAMP)
	@for script in benchmarks/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

# The documentation is Markdown read in place; this proves that no link in it is dead.
docs: $(STAMP)
	$(BIN)/python -m pytest -q tests/unit/test_docs.py

demo: $(STAMP)
	$(BIN)/zonemill demo --out $(OUT)

serve: $(STAMP)
	$(BIN)/zonemill serve --port $(PORT)

LOCK_FLAGS = --universal --python-version 3.11 --no-header --no-emit-index-url --no-annotate -q
lock:
	uv pip compile pyproject.toml --extra dev $(LOCK_FLAGS) -o requirements.lock
	uv pip compile pyproject.toml --extra dev --extra bench $(LOCK_FLAGS) -c requirements.lock -o requirements-bench.lock

clean:
	rm -rf build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache
