# make demo   a first run on data that comes along, and its report
# make test   lint, types and tests
# Both make their own environment in .venv first; another Python is named by PYTHON=python3.12.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: demo test lint types unit clean

demo: $(VENV)/.installed
	rm -rf results/demo
	$(BIN)/bench run --out results/demo

test: lint types unit

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# Tests import the package by its name, and a type checker cannot follow an editable install: a link shows it the way.
types: $(VENV)/.installed-dev
	mkdir -p build/types
	ln -sfn ../.. build/types/slamduel
	$(BIN)/basedpyright --pythonpath $(BIN)/python

unit: $(VENV)/.installed-dev
	$(BIN)/pytest -n auto

$(VENV)/.installed: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(f"Python 3.11 or newer is needed, found {sys.version.split()[0]}; name one with PYTHON=python3.12" if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/.installed
	$(PIP) --editable '.[dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info results .pytest_cache .ruff_cache .hypothesis
