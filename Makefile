# Each of these works alone on a fresh clone, given Python 3.11 or newer and pip.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
TORCH := torch==2.13.0

.PHONY: setup run test coverage lint docs bench lock

setup: $(VENV)/.ready

# torch first and by its exact version: a plain "torch" may bring a build for another accelerator.
$(VENV)/.ready: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit("ertskin needs Python 3.11 or newer, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt $(TORCH)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev,cluster,docs]'
	touch $@

run: setup
	$(BIN)/ertskin run

test: setup
	$(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile --no-loadscope-reorder

# Lines of the diagnosis and of the instruments that their own tests run; what numba compiles and other processes run counts not.
coverage: setup
	$(BIN)/python -m pytest --numprocesses logical --maxprocesses 4 --dist loadfile \
		--cov=src/ertskin/diagnosis --cov=hardware --cov-report=term tests/ertskin/diagnosis tests/hardware

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The site in runs/site: open its index.html. Installed once, it is built without a network.
docs: $(VENV)/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

$(VENV)/.docs: setup
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[docs]'
	touch $@

# pyEIT is there for comparison only.
bench: setup
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[bench]'
	$(BIN)/python experiments/benchmarks/run.py

# The versions everything was tested with, from what is installed now.
lock: setup
	$(BIN)/python -m pip freeze --exclude-editable | sed -E 's/\+[a-z0-9.]+$$//; /@ /d' > constraints.txt
