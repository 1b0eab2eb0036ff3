# Every target works from a bare checkout: the first one makes its own environment in $(VENV).
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: help demo test test-all lint types bench study study-faults study-coverage docs clean

help:
	@echo "make demo   two lanes of Belgian block, from the recordings to a report: demo/"
	@echo "make test   tests, and the examples in the docstrings and the documentation"
	@echo "make test-all  the same, then the slow ones: statistical campaigns, whole surveys"
	@echo "make lint   style, formatting, import contracts, words of the notation"
	@echo "make types  static types"
	@echo "make bench  speed, beside the peer in the same run"
	@echo "make study  vehicles judge which reduction of the ground serves which use (minutes)"
	@echo "make study-faults    faults of a profiler, injected: what the tests of accuracy find"
	@echo "make study-coverage  how often intervals of the tests of accuracy hold the truth"
	@echo "make docs   documentation: docs/_build/html/index.html"
	@echo "make clean  remove the environment and everything that was built"

$(INSTALLED): pyproject.toml uv.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "trueterrain needs Python 3.11 or newer: make PYTHON=python3.12 ..."; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	UV_PROJECT_ENVIRONMENT=$(abspath $(VENV)) $(BIN)/uv sync --quiet --frozen --all-extras \
		--all-groups --python $(BIN)/python --compile-bytecode
	@touch $@

demo: $(INSTALLED)
	$(BIN)/trueterrain demo --output demo --force

test: $(INSTALLED)
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile -m "not slow"

test-all: test
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal -m slow

lint: $(INSTALLED)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports
	$(BIN)/python tools/check_words.py

types: $(INSTALLED)
	$(BIN)/mypy

bench: $(INSTALLED)
	$(BIN)/python benchmarks

study: $(INSTALLED)
	$(BIN)/python studies/response

study-faults: $(INSTALLED)
	$(BIN)/python studies/faults

study-coverage: $(INSTALLED)
	$(BIN)/python studies/coverage

docs: $(INSTALLED)
	rm -rf docs/reference/generated
	$(BIN)/sphinx-build --fresh-env --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

clean:
	rm -rf $(VENV) demo dist docs/_build docs/gallery docs/reference/generated \
		.pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks docs studies -name __pycache__ -prune -exec rm -rf {} +
