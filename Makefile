# Plain pip and python lines, in a .venv that is made here. Each target works as the first command
# on a fresh machine.

PORT ?= 8501
VENV := .venv
PYTHON := $(VENV)/bin/python
BROWSER := /usr/bin/chromium
COMPILER := /usr/bin/cc
DATABASE := /usr/bin/pg_createcluster

# The first interpreter that Box2D has wheels for.
FIND_PYTHON = for name in python3 python3.13 python3.12 python3.11; do \
	  $$name -c 'import ensurepip, sys, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' \
	    2>/dev/null && echo $$name && break; done

.PHONY: app test lint format docs lowest bench fuzz clean
.DELETE_ON_ERROR:

app: $(VENV)/runtime.stamp  ## start the dashboard
	@echo "The dashboard is at http://localhost:$(PORT) (Ctrl-C ends it)."
	$(PYTHON) -m streamlit run app.py --server.port $(PORT)

test: $(VENV)/development.stamp $(BROWSER) $(COMPILER) $(DATABASE)  ## run every test
	$(PYTHON) -m pytest --numprocesses 3 --dist loadfile

lint: $(VENV)/development.stamp  ## style, types, and who may import whom
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy
	$(VENV)/bin/lint-imports

format: $(VENV)/development.stamp  ## bring every file into shape
	$(PYTHON) -m ruff check --fix-only .
	$(PYTHON) -m ruff format .

docs: $(VENV)/development.stamp $(BROWSER) $(COMPILER)  ## the guide, in out/docs; its links and its examples are tried
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet
	$(PYTHON) -m pytest tests/test_docs.py tests/test_examples.py
	@echo "The guide is in out/docs/index.html."

LOWEST := .venv-lowest/bin/python
LIBRARY := mining shielding demonstrations environments agents rollouts rendering explaining cli

lowest: requirements-lowest.txt $(COMPILER)  ## test the library at the lower ends of its dependencies' ranges
	test -x $(LOWEST) || $$($(FIND_PYTHON)) -m venv .venv-lowest
	$(LOWEST) -m pip install --requirement requirements-lowest.txt
	$(LOWEST) -m pytest $(addprefix tests/,$(LIBRARY))

bench: $(VENV)/development.stamp $(BROWSER)  ## measure, and compare with what is to be reached
	$(PYTHON) -m benchmarks

MINUTES ?= 10

fuzz: $(VENV)/development.stamp  ## try every reader with damaged files, MINUTES each; READERS="csv npz" for some
	$(PYTHON) -m tests.fuzz --minutes $(MINUTES) $(READERS)

clean:  ## remove what the tools made; the .venv stays
	$(RM) -r .mypy_cache .pytest_cache .ruff_cache .import_linter_cache .hypothesis .fuzz
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec $(RM) -r {} +

$(PYTHON):
	@test -n "$$($(FIND_PYTHON))" || \
	  { echo "error: Python 3.11, 3.12 or 3.13 with venv is needed and none was found; install one and run make again" >&2; exit 2; }
	$$($(FIND_PYTHON)) -m venv $(VENV)

$(VENV)/runtime.stamp: requirements.txt | $(PYTHON)
	$(PYTHON) -m pip install --requirement requirements.txt
	@touch $@

$(VENV)/development.stamp: requirements.txt requirements-dev.txt | $(PYTHON)
	$(PYTHON) -m pip install --requirement requirements-dev.txt
	@touch $@ $(VENV)/runtime.stamp

$(BROWSER):
	@command -v apt-get >/dev/null && { test "$$(id -u)" = 0 || command -v sudo >/dev/null; } || \
	  { echo "error: the browser tests need $(BROWSER); have an administrator install the package chromium and run make again" >&2; exit 2; }
	$(AS_ROOT) apt-get update
	$(AS_ROOT) apt-get install --yes --no-install-recommends chromium

$(COMPILER):
	@command -v apt-get >/dev/null && { test "$$(id -u)" = 0 || command -v sudo >/dev/null; } || \
	  { echo "error: the tests of exported C code need $(COMPILER); have an administrator install the packages gcc and libc6-dev and run make again" >&2; exit 2; }
	$(AS_ROOT) apt-get update
	$(AS_ROOT) apt-get install --yes --no-install-recommends gcc libc6-dev

$(DATABASE):
	@command -v apt-get >/dev/null && { test "$$(id -u)" = 0 || command -v sudo >/dev/null; } || \
	  { echo "error: the tests of a library in PostgreSQL need its server; have an administrator install the package postgresql and run make again" >&2; exit 2; }
	$(AS_ROOT) apt-get update
	$(AS_ROOT) apt-get install --yes --no-install-recommends postgresql

AS_ROOT = $(shell test "$$(id -u)" = 0 || echo sudo)
