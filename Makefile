# make demo                 a first run on data that comes along, and its report
# make test                 lint, types and all tests that are quick
# make test-slow            the strict check of types, and the other tests: browsers, clusters, kills, large samples
# make test-dist           the source archive and the wheel, and the quick tests of the one on the other
# make test-older           the quick tests as two older machines would run them
# make test-newest          the quick tests with the newest numba, in an environment of their own
# make coverage             the quick tests, and how much of the Python that is not compiled they run
# make docs                the documentation as a site, build/docs/index.html; its notebook runs
# make docs-tables          the tables of docs/backends.md and docs/datasets.md, from the registries, and docs/standing.md from its own
# make mrclam-noise        the noise of robots of MRCLAM's set 6, on all and without each, from the copy of bench fetch mrclam-6
# make plaza-noise         the noise of each of CMU's Plaza logs, from GTSAM's package
# make gallery              the classic studies in their quick size, and one page with all their answers
# make study-city           an EKF with 10,000 landmarks
# make study-statistics     how often the verdict is right: 10,000 simulated comparisons
# make study-mutations      2,000 mutated logs, bags, plug-ins and records: each refused, remarked on, or as good as before
# make study-locating       200 starts anywhere on six maps and as many on maps of other worlds, 100 robots carried elsewhere
# make study-settings      the front ends' settings and the smoother's, each halved and doubled: half an hour; SLAMDUEL_DATA=
# make study-laser         63 laser logs, each 20 times with changes that should not matter: two hours; SLAMDUEL_DATA=
# make study-mistakes      1,050 logs with one of 25 mistakes or none: how often it is named, an hour
# make study-noise          how often the intervals of bench noise have the true noise: 600 simulated logs
# make study-mountings      a sensor planted 5 cm ahead and 50 ms late: how often bench noise has it, 25 minutes; LOGS=200, SLAMDUEL_DATA=
# make study-kills          a study killed at 20 random moments ends as if it had been left in peace
# All make their own environment in .venv first; another Python is named by PYTHON=python3.12.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --constraint constraints.txt

# One thread each: two workers with two BLAS threads each wait for one another more than they work.
PYTEST := env OMP_NUM_THREADS=1 $(BIN)/pytest -n auto --dist worksteal

# A process that may not keep bytecode compiles all that it imports at each start: three seconds instead of one.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-slow test-dist test-older test-newest coverage lint types types-strict unit clean docs docs-tables mrclam-noise plaza-noise gallery study-city \
	study-statistics study-kills study-mutations study-locating study-noise study-mountings study-settings study-laser study-mistakes

demo: $(VENV)/.installed
	rm -rf results/demo
	$(BIN)/bench run --dataset aruco-room,victoria-park --out results/demo

test: lint types unit

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# Tests import the package by its name, and a type checker cannot follow an editable install: a link shows it the way.
LAYERS := $(addprefix slamduel/,core frontend backends datasets bench tests)

build/types/slamduel:
	mkdir -p build/types
	ln -sfn ../.. $@

# In some ten seconds; the strict one takes as long as all quick tests together.
types: $(VENV)/.installed-dev build/types/slamduel
	cd build/types && $(abspath $(BIN))/ty check --output-format concise --python $(abspath $(VENV)) $(LAYERS)

types-strict: $(VENV)/.installed-dev build/types/slamduel
	$(BIN)/basedpyright --pythonpath $(BIN)/python --threads 2

unit: $(VENV)/.installed-dev
	$(PYTEST) -m "not slow"

test-slow: types-strict
	$(PYTEST) -m slow

# What is released, alone: the wheel, built from the source archive and installed, and the tests of that archive.
test-dist: $(VENV)/.installed-dev
	rm -rf dist build/dist
	mkdir -p build/dist
	$(BIN)/python -m build --no-isolation --outdir dist
	tar -xzf dist/slamduel-*.tar.gz -C build/dist --strip-components 1
	$(PYTHON) -m venv build/dist/.venv
	build/dist/.venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
		"slamduel[dev] @ file://$$(echo $(CURDIR)/dist/slamduel-*.whl)"
	cd build/dist && env OMP_NUM_THREADS=1 .venv/bin/pytest -n auto --dist worksteal -m "not slow"

# As on two older machines: libraries and kernels leave aside what those processors lacked.
test-older: $(VENV)/.installed-dev
	for kind in haswell nehalem; do \
		$(BIN)/python tests/support/older_machine.py $$kind $(PYTEST) -m "not slow" || exit 1; \
	done

test-newest:
	$(MAKE) VENV=build/newest build/newest/.installed-dev
	build/newest/bin/python -m pip install --quiet --disable-pip-version-check --upgrade numba
	$(MAKE) VENV=build/newest unit

# Statements that ran in any process of the quick tests: those that start a process of their own are most of the commands'.
coverage: $(VENV)/.installed-dev
	rm -rf build/coverage
	$(BIN)/coverage run -m pytest -n auto --dist worksteal -m "not slow"
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

docs: $(VENV)/.installed-docs
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -b html -d build/docs-doctrees docs build/docs
	@echo "site: build/docs/index.html"

docs-tables: $(VENV)/.installed
	$(BIN)/python docs/tables.py

# A finding that is not reproduced is an answer, too.
gallery: $(VENV)/.installed
	for study in $(basename $(notdir $(wildcard bench/study/studies/*.toml))); do \
		$(BIN)/bench ablate $$study --out results/gallery/$$study; test $$? -le 1 || exit 1; \
	done
	$(BIN)/python -m slamduel.bench.study_report.gallery results/gallery

# What mrclam[noise=others] states.
mrclam-noise: $(VENV)/.installed
	$(BIN)/bench noise 'mrclam[robot=all]' --quiet --save datasets/published/noise/mrclam-6.toml
	for k in 1 2 3 4 5; do \
		$(BIN)/bench noise $$(for j in 1 2 3 4 5; do [ $$j = $$k ] || echo "mrclam[robot=$$j]"; done) --quiet \
			--save datasets/published/noise/mrclam-6-without-$$k.toml || exit 1; \
	done

plaza-noise: $(VENV)/.installed
	for k in 1 2; do $(BIN)/bench noise "plaza[log=$$k]" --quiet --save datasets/beacons/noise/plaza-$$k.toml || exit 1; done

study-city: $(VENV)/.installed
	rm -rf results/study-city
	$(BIN)/bench run --out results/study-city --dataset 'city[landmarks=10000,steps=20000]' --backend ekf --seeds 1 --memory 5000

study-statistics: $(VENV)/.installed
	$(BIN)/python -m slamduel.bench.verdict.simulation

study-mutations: $(VENV)/.installed-dev
	PYTHONPATH=tests/support $(BIN)/python -m mutants 2000

study-locating: $(VENV)/.installed-dev
	$(BIN)/python tests/support/locating_trials.py 200

study-settings: $(VENV)/.installed-dev
	PYTHONPATH=tests/support env OMP_NUM_THREADS=1 $(BIN)/python tests/support/settings_trials.py

study-laser: $(VENV)/.installed-dev
	PYTHONPATH=tests/support env OMP_NUM_THREADS=1 $(BIN)/python tests/support/laser_trials.py

study-mistakes: $(VENV)/.installed-dev
	PYTHONPATH=tests/support env OMP_NUM_THREADS=1 $(BIN)/python tests/support/mistaken_logs.py

study-noise: $(VENV)/.installed-dev
	PYTHONPATH=tests/support $(BIN)/python -m noise_coverage 200

study-mountings: $(VENV)/.installed-dev
	PYTHONPATH=tests/support env OMP_NUM_THREADS=1 $(BIN)/python -m mounting_coverage $(or $(LOGS),200)

study-kills: $(VENV)/.installed-dev
	$(BIN)/python tests/support/kills.py 20

$(VENV)/pyvenv.cfg:
	@$(PYTHON) -c 'import sys; sys.exit(f"Python 3.11 or newer is needed, found {sys.version.split()[0]}; name one with PYTHON=python3.12" if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) --editable .
	touch $@

$(VENV)/.installed-dev: $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) --editable '.[dev]'
	touch $(VENV)/.installed $@

$(VENV)/.installed-docs: $(VENV)/.installed
	$(PIP) --editable '.[docs]'
	touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info results .pytest_cache .ruff_cache .hypothesis
