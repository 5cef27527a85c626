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
# uv installs into a given interpreter; plain pip is called by the interpreter itself. Both without bars: SHOW makes a
# line of their output, so that no stretch over 5 s is silent.
PIP_OPTIONS = install --disable-pip-version-check --progress-bar off
INSTALL = $(if $(UV),uv pip install --no-progress --python $(BIN)/python,$(BIN)/python -m pip $(PIP_OPTIONS))
SHOW := $(PYTHON) .ci/progress.py

.PHONY: setup hooks peers check types test test-cov test-slow limits test-runtime soak image clients audit kernels golden bench bench-jobs docs demo serve lock third-party clean

# The page wants Node 20.19 or newer with npm; where there is none, that of a wheel is put into .venv.
PAGE := service/page/index.html
NODE := $(shell npm --version >/dev/null 2>&1 && node -e 'const [a, b] = process.versions.node.split("."); process.exit(a > 20 || (a == 20 && b >= 19) ? 0 : 1)' >/dev/null 2>&1 && echo yes)
PAGE_PATH = $(if $(NODE),,PATH="$(CURDIR)/$(BIN):$$PATH")

.PHONY: web page lint-web

setup: $(STAMP) hooks page

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "Python 3.11 or newer is needed; try make PYTHON=python3.12 setup"; exit 1; }
	@$(SHOW) "making $(VENV)" $(if $(UV),uv venv -q --python $(PYTHON) $(VENV),$(PYTHON) -m venv $(VENV))

$(STAMP): requirements.lock pyproject.toml | $(BIN)/python
	@$(SHOW) --of requirements.lock "installing requirements.lock (about 2 GB)" $(INSTALL) --no-deps -r requirements.lock
	@$(SHOW) "installing zonemill" $(INSTALL) --no-deps -e .
	$(BIN)/zonemill warm
	@touch $@

$(BENCH_STAMP): requirements-bench.lock $(STAMP)
	@$(SHOW) --of requirements-bench.lock "installing requirements-bench.lock" $(INSTALL) --no-deps -r requirements-bench.lock
	@touch $@

# The check of commit messages, where this is a git clone that has no hooks of its own.
hooks:
	@.ci/install-hooks

# Programs by others that judge ours; tests that want them skip without, with the reason.
peers: $(BENCH_STAMP)

web: $(PAGE)

$(PAGE): $(wildcard web/*.json web/*.js web/*.html web/src/* web/src/*/*) openapi.yaml requirements-web.lock | $(BIN)/python
	$(if $(NODE),,@$(SHOW) "installing Node for the page" $(INSTALL) --no-deps -r requirements-web.lock)
	@$(PAGE_PATH) $(SHOW) "installing the packages of the page" npm --prefix web ci --loglevel=http
	@$(PAGE_PATH) $(SHOW) "building the page" npm --prefix web run build
	@touch $@

# Whoever cannot get the packages of the page has everything but the page, and is told.
page: | $(BIN)/python
	@$(MAKE) --no-print-directory -s web || echo "The page was not built, for the reason above. All else works. Remedy: make web"

# The linter of the page; it says so and goes on where the packages of the page are missing.
lint-web:
	@if [ -f web/node_modules/eslint/package.json ] && [ -f web/src/wire.ts ]; then cd web && $(PAGE_PATH) npm run --silent lint; \
	else echo "web/ is not linted: the packages of the page are not installed. Remedy: make web"; fi

check: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy
	$(BIN)/python .ci/plain_words.py
	$(BIN)/python .ci/docstrings.py
	$(BIN)/python -m pytest -q tests/unit/house/test_docstrings.py tests/unit/house/test_dependencies.py

test: $(STAMP) page
	$(BIN)/python -m pytest -q -m "not slow and not soak" -n 2 --dist worksteal

# The everyday tests with the share of Python lines they run. Kernels are left out: they run as machine code, whose lines
# Python cannot count, and uncompiled (NUMBA_DISABLE_JIT=1) they are too slow for these tests.
test-cov: $(STAMP) page
	$(BIN)/python -m pytest -q -m "not slow and not soak" -n 2 --dist worksteal --cov --cov-report=term $(if $(K),-k "$(K)")

test-slow: $(STAMP)
	$(BIN)/python -m pytest -q -m "slow and not soak" -n 2 --dist worksteal --durations 20 --ignore tests/contract/test_clients.py

# The tests that watch the clock, with the limits of an idle machine; the everyday run allows 20 times as much.
limits: $(STAMP)
	ZONEMILL_LIMITS=1 $(BIN)/python -m pytest -q -m "not slow and not soak" $$(grep -rl "in_time(" tests --include='test_*.py')

# The tests on the runtime lock, in an environment without cadquery; make test-runtime RUNTIME_TESTS=tests runs every
# everyday test that draws no part itself. The development environment writes the parts beforehand.
RUNTIME := .venv-runtime
RUNTIME_TESTS ?= tests/runtime
test-runtime: $(STAMP) $(RUNTIME)/.installed
	$(BIN)/python -m tests.runtime.write_parts build/runtime-parts
	ZONEMILL_PARTS=$(CURDIR)/build/runtime-parts ZONEMILL_NO_SKIP=cadquery \
	$(RUNTIME)/bin/python -m pytest -q -m "not slow and not soak" $(RUNTIME_TESTS)

$(RUNTIME)/.installed: requirements-runtime.lock requirements.lock pyproject.toml
	@$(SHOW) "making $(RUNTIME)" $(PYTHON) -m venv --clear $(RUNTIME)
	@$(SHOW) --of requirements-runtime.lock "installing requirements-runtime.lock (about 0.9 GB)" \
	  $(RUNTIME)/bin/python -m pip $(PIP_OPTIONS) --no-deps -r requirements-runtime.lock
	@$(SHOW) "installing zonemill" $(RUNTIME)/bin/python -m pip $(PIP_OPTIONS) --no-deps -e .
	@$(RUNTIME)/bin/python -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['dependency-groups']['test'], sep='\n')" >$(RUNTIME)/test-tools
	@$(SHOW) "installing the tools of tests" \
	  $(RUNTIME)/bin/python -m pip $(PIP_OPTIONS) -r $(RUNTIME)/test-tools -c requirements.lock
	@touch $@

# What takes longer than CI waits; each test prints its figures. K chooses among them, SOAK_COUNT=50, FAULT_REPEAT=5 and
# LOAD_MINUTES=2 are for a quick look.
soak: $(STAMP)
	$(BIN)/python -m pytest -q -s -m soak $(if $(K),-k "$(K)")

# The container image where an engine answers; elsewhere the stages of the Dockerfile in folders below build/image.
image:
	@if docker info >/dev/null 2>&1; then docker build --tag zonemill:local .; else $(PYTHON) .ci/image_stages.py build/image; fi

# Clients in four languages: generated, compiled, each runs a whole job; skips, with the reason, what is not installed.
clients: $(STAMP)
	$(BIN)/python -m pytest -q -rs tests/contract/test_clients.py

# Known vulnerabilities of dependencies, where advisories can be reached.
audit: $(STAMP)
	$(BIN)/python .ci/audit.py build/audit

# Rewrites the list of kernels that `zonemill warm` compiles on all cores; a test tells when it is due.
kernels: $(STAMP)
	$(BIN)/python .ci/kernel_signatures.py

# Rewrites the expected files; the diff is what gets reviewed.
golden: $(STAMP)
	ZONEMILL_GOLDEN=1 $(BIN)/python -m pytest -q $$(grep -rl assert_golden tests --include='test_*.py')
	git --no-pager diff --stat -- tests/golden

bench: $(BENCH_STAMP)
	@for script in benchmarks/*/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

# Whole jobs by stage, beside the code of another commit: make bench-jobs BEFORE=COMMIT JOBS="demo plate".
bench-jobs: $(STAMP)
	$(BIN)/python benchmarks/jobs/jobs_before_after.py $(JOBS) $(if $(BEFORE),--before $(BEFORE))

# The documentation is Markdown read in place; this proves that no link in it is dead.
docs: $(STAMP)
	$(BIN)/python -m pytest -q tests/unit/house/test_docs.py

demo: $(STAMP) page
	$(BIN)/zonemill demo --out $(OUT)

serve: $(STAMP) page
	$(BIN)/zonemill serve --port $(PORT)

# Development installs cadquery, whose kernel wheel has the same files as that of the product: no lock holds both.
LOCK_FLAGS = --universal --python-version 3.11 --no-header --no-emit-index-url --no-annotate -q
DEV_LOCK_FLAGS = $(LOCK_FLAGS) --group dev --no-emit-package cadquery-ocp-novtk
lock:
	uv pip compile pyproject.toml $(DEV_LOCK_FLAGS) -o requirements.lock
	uv pip compile pyproject.toml $(DEV_LOCK_FLAGS) --group bench -c requirements.lock -o requirements-bench.lock
	uv pip compile pyproject.toml $(LOCK_FLAGS) --extra cluster -c requirements.lock -o requirements-runtime.lock

third-party: $(STAMP)
	$(BIN)/python .ci/third_party.py requirements-runtime.lock requirements.lock web/package-lock.json

clean:
	rm -rf service/page web/node_modules web/src/wire.ts build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .coverage
