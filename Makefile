# Needs nothing but make and Python 3.11 or newer; everything else goes into $(VENV).
#   make demo ARGS="--help"            options of the demo
#   make test ARGS="-k statistics"     options of pytest
#   make docs ARGS=--links             ask the sites that the documentation links to
#   make site-zip                      the site in one file, dist/hybrid-site.zip
#   make wheels                        what is released, in dist/
PYTHON ?= python3
VENV ?= .venv
ARGS ?=

BIN := $(VENV)/bin
# Kernels are compiled when a wheel is built; an editable installation compiles them when a run needs them.
PIP_INSTALL := HATCH_BUILD_NO_HOOKS=true $(BIN)/python -m pip install --quiet --disable-pip-version-check

.DELETE_ON_ERROR:
.PHONY: demo test lint docs site-zip wheels clean

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

site-zip: docs
	mkdir -p dist
	cd build/site && $(abspath $(BIN)/python) -m zipfile --create $(CURDIR)/dist/hybrid-site.zip html

# The sources, and a wheel of them with kernels for all processors of this machine's family; both are tried out.
wheels: $(VENV)/.installed-release
	rm -rf dist/hybrid_systems-*
	HYBRID_WHEEL=family $(BIN)/python -m build --outdir dist
	$(BIN)/python .ci/bare.py build/bare dist/hybrid_systems-*.whl

clean:
	rm -rf build dist $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis
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
