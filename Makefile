# make demo                 a first run on data that comes along, and its report
# make test                 lint, types and tests
# make study-isam2          iSAM2's settings against one another
# make study-consistency    which EKFs are as sure of themselves as they may be, on 50 of Huang's circles
# make study-city           an EKF with 10,000 landmarks
# make study-matlab-report  the Matlab report's finding: 12 tags against 6, on 50 seeds
# make study-statistics     how often the verdict is right: 10,000 simulated comparisons
# All make their own environment in .venv first; another Python is named by PYTHON=python3.12.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt

.PHONY: demo test lint types unit clean study-isam2 study-consistency study-city study-matlab-report study-statistics

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
	$(BIN)/basedpyright --pythonpath $(BIN)/python --threads 2

# One thread each: two workers with two BLAS threads each wait for one another more than they work.
unit: $(VENV)/.installed-dev
	OMP_NUM_THREADS=1 $(BIN)/pytest -n auto --dist worksteal

# Settings of iSAM2 against one another: what each costs a step, and how far it ends from the optimum.
ISAM2_VARIANTS := isam2 isam2[relinearize_skip=1] isam2[relinearize_skip=10] isam2[relinearize_skip=1000] \
	isam2[relinearize_threshold=0.1] isam2[relinearize_threshold=0.01] \
	isam2[relinearize_skip=10,relinearize_threshold=0.1] isam2[partial_check=true] isam2[factorization=cholesky]

study-isam2: $(VENV)/.installed
	rm -rf results/study-isam2
	$(BIN)/bench run --out results/study-isam2 --dataset aruco-room,victoria-park --seeds 2 \
		$(foreach variant,$(ISAM2_VARIANTS),--backend '$(variant)')

# A filter that gives up is a finding here, not a failure of the study.
study-consistency: $(VENV)/.installed
	rm -rf results/study-consistency
	-$(BIN)/bench run --out results/study-consistency --oracle --dataset circle --seeds 50 \
		--backend 'ekf[jacobians=ideal],ekf[jacobians=first-estimates],invariant-ekf,ekf,ukf'

study-city: $(VENV)/.installed
	rm -rf results/study-city
	$(BIN)/bench run --out results/study-city --dataset 'city[landmarks=10000,steps=20000]' --backend ekf --seeds 1 --memory 5000

study-matlab-report: $(VENV)/.installed
	rm -rf results/study-matlab-report
	$(BIN)/bench run --out results/study-matlab-report --dataset 'matlab-report,matlab-report[tags=12]' --seeds 50 \
		--backend dead-reckoning,ekf,isam2

study-statistics: $(VENV)/.installed
	$(BIN)/python -m slamduel.bench.statistics_study

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
