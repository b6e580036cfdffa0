# Needs nothing but make and Python 3.11 or newer; everything else goes into $(VENV).
#   make demo ARGS="--help"            options of the demo
#   make test ARGS="-k statistics"     options of pytest
#   make docs ARGS=--links             ask the sites that the documentation links to
PYTHON ?= python3
VENV ?= .venv
ARGS ?=

BIN := $(VENV)/bin
# Kernels are compiled when a wheel is built; an editable installation compiles them when a run needs them.
PIP_INSTALL := HATCH_BUILD_NO_HOOKS=true $(BIN)/python -m pip install --quiet --disable-pip-version-check

.DELETE_ON_ERROR:
.PHONY: demo test lint docs clean

demo: $(VENV)/.installed
	$(BIN)/python -m lyapunov $(ARGS)

# Each process of the tests would compile the kernels that it needs. Tests of one file run in one process, which
# compiles their models once.
test: $(VENV)/.installed-test
	$(BIN)/python -m hybrid compile
	$(BIN)/python -m pytest -n auto --dist loadfile $(ARGS)

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The site opens from the file system: build/site/html/index.html.
docs: $(VENV)/.installed-docs
	$(BIN)/python docs/make_site.py $(ARGS)

clean:
	rm -rf build $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find hybrid models lyapunov tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else \
	    "Python 3.11 or newer is needed, and $(PYTHON) is " + sys.version.split()[0] \
	    + ". Name another one: make PYTHON=/path/to/python3")'
	$(PYTHON) -m venv $(VENV)

# The stamps are made anew when the dependencies change; the sources are installed as links.
$(VENV)/.installed: pyproject.toml | $(BIN)/python
	@echo "Installing the library and what it needs into $(VENV) ..."
	$(PIP_INSTALL) -e .
	@touch $@

$(VENV)/.installed-%: pyproject.toml | $(BIN)/python
	@echo "Installing the library and what it needs for $* into $(VENV) ..."
	$(PIP_INSTALL) -e '.[$*]'
	@touch $@
