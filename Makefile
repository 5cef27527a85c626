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

.PHONY: setup hooks peers check types test test-cov test-slow soak clients audit golden bench docs demo serve lock third-party clean

# The page wants Node 20.19 or newer with npm; where there is none, that of a wheel is put into .venv.
PAGE := service/page/index.html
NODE := $(shell npm --version >/dev/null 2>&1 && node -e 'const [a, b] = process.versions.node.split("."); process.exit(a > 20 || (a == 20 && b >= 19) ? 0 : 1)' >/dev/null 2>&1 && echo yes)
NPM = $(if $(NODE),npm,PATH="$(CURDIR)/$(BIN):$$PATH" npm)

.PHONY: web page lint-web

setup: $(STAMP) hooks page

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

# The check of commit messages, where this is a git clone that has no hooks of its own.
hooks:
	@.ci/install-hooks

# Programs by others that judge ours; tests that want them skip without, with the reason.
peers: $(BENCH_STAMP)

web: $(PAGE)

$(PAGE): $(wildcard web/*.json web/*.js web/*.html web/src/* web/src/*/*) openapi.yaml requirements-web.lock | $(BIN)/python
	$(if $(NODE),,$(INSTALL) --no-deps -r requirements-web.lock)
	cd web && $(NPM) ci --loglevel=error
	cd web && $(NPM) run --silent build
	@touch $@

# Whoever cannot get the packages of the page has everything but the page, and is told.
page: | $(BIN)/python
	@$(MAKE) --no-print-directory -s web || echo "The page was not built, for the reason above. All else works. Remedy: make web"

# The linter of the page; it says so and goes on where the packages of the page are missing.
lint-web:
	@if [ -f web/node_modules/eslint/package.json ] && [ -f web/src/wire.ts ]; then cd web && $(NPM) run --silent lint; \
	else echo "web/ is not linted: the packages of the page are not installed. Remedy: make web"; fi

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/unit/house/test_docstrings.py tests/unit/house/test_dependencies.py

test: $(STAMP) page
	$(BIN)/python -m pytest -q -m "not slow and not soak" -n 2 --dist worksteal

# The everyday tests with the share of Python lines they run. Kernels are left out: they run as machine code, whose lines
# Python cannot count, and uncompiled (NUMBA_DISABLE_JIT=1) they are too slow for these tests.
test-cov: $(STAMP) page
	$(BIN)/python -m pytest -q -m "not slow and not soak" -n 2 --dist worksteal --cov --cov-report=term $(if $(K),-k "$(K)")

test-slow: $(STAMP)
	$(BIN)/python -m pytest -q -m "slow and not soak" --ignore tests/contract/test_clients.py

# What takes longer than CI waits; each test prints its figures. K chooses among them, SOAK_COUNT=50, FAULT_REPEAT=5 and
# LOAD_MINUTES=2 are for a quick look.
soak: $(STAMP)
	$(BIN)/python -m pytest -q -s -m soak $(if $(K),-k "$(K)")

# Clients in four languages: generated, compiled, each runs a whole job; skips, with the reason, what is not installed.
clients: $(STAMP)
	$(BIN)/python -m pytest -q -rs tests/contract/test_clients.py

# Known vulnerabilities of dependencies, where advisories can be reached.
audit: $(STAMP)
	$(BIN)/python .ci/audit.py build/audit

# Rewrites the expected files; the diff is what gets reviewed.
golden: $(STAMP)
	ZONEMILL_GOLDEN=1 $(BIN)/python -m pytest -q $$(grep -rl assert_golden tests --include='test_*.py')
	git --no-pager diff --stat -- tests/golden

bench: $(BENCH_STAMP)
	@for script in benchmarks/*/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

# The documentation is Markdown read in place; this proves that no link in it is dead.
docs: $(STAMP)
	$(BIN)/python -m pytest -q tests/unit/house/test_docs.py

demo: $(STAMP) page
	$(BIN)/zonemill demo --out $(OUT)

serve: $(STAMP) page
	$(BIN)/zonemill serve --port $(PORT)

LOCK_FLAGS = --universal --python-version 3.11 --no-header --no-emit-index-url --no-annotate -q
lock:
	uv pip compile pyproject.toml --extra dev $(LOCK_FLAGS) -o requirements.lock
	uv pip compile pyproject.toml --extra dev --extra bench $(LOCK_FLAGS) -c requirements.lock -o requirements-bench.lock

third-party: $(STAMP)
	$(BIN)/python .ci/third_party.py requirements.lock web/package-lock.json

clean:
	rm -rf service/page web/node_modules web/src/wire.ts build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .coverage
