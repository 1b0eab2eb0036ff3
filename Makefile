# Each target works in a bare checkout: the first one creates the environment in $(VENV).
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: help demo test test-all coverage lint types bench bench-long study study-faults study-coverage study-table docs clean

help:
	@echo "make demo   simulate and process a survey of two lanes of Belgian block: demo/report.html"
	@echo "make test   run the tests and the examples in docstrings and documentation"
	@echo "make test-all  the same, then the slow tests: statistical campaigns, whole surveys"
	@echo "make coverage  measure the branch coverage of the tests, kernels as plain Python"
	@echo "make lint   check style, formatting, import contracts and words"
	@echo "make types  check static types"
	@echo "make bench  measure speed and memory, and those of the peer, in the same run"
	@echo "make bench-long  the same for an hour of recording (needs 15 GB of disk, half an hour)"
	@echo "make study  compare reductions of the ground by the response of vehicles (minutes)"
	@echo "make study-faults    inject faults into a profiler and run the accuracy tests on it"
	@echo "make study-coverage  measure the coverage of the intervals of the accuracy tests"
	@echo "make study-table     reproduce Table 3-1 of the thesis with the virtual profiler (a minute)"
	@echo "make docs   build the documentation: docs/_build/html/index.html"
	@echo "make clean  remove the environment and all build products"

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
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal \
		-m "slow or hypothesis" --hypothesis-profile thorough

# Tests of kernels with inputs small enough for plain Python, above all the examples in docstrings.
KERNEL_TESTS := src tests/alignment/test_network_system.py tests/alignment/test_spline.py \
	tests/georeference/test_calibrate_derivatives.py tests/profile/test_area.py \
	tests/profile/test_envelope_rigid.py tests/profile/test_envelope_springs.py \
	tests/roughness/test_quarter_car.py tests/simulate/test_noise.py tests/simulate/test_scanner.py \
	tests/simulate/test_shapes.py tests/surface/test_line.py tests/vehicle/test_contact.py \
	-k "not (moving_scan or first_intersection or size_of_a_block or mean_of_its_rays)" \
	--deselect src/trueterrain/core/kernels.py::trueterrain.core.kernels.compile_kernel

# First all quick tests; then those of kernels with compilation off, since compiled lines are not
# seen. There hashes of 64 bits warn that they overflow, as they are meant to.
coverage: $(INSTALLED)
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile -m "not slow" \
		--cov --cov-report= --cov-fail-under=0
	NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest --numprocesses auto --dist loadfile \
		-m "not slow" -W "ignore:overflow encountered:RuntimeWarning" \
		--cov --cov-append --cov-report=term $(KERNEL_TESTS)

lint: $(INSTALLED)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports
	$(BIN)/python tools/check_words.py

types: $(INSTALLED)
	$(BIN)/mypy

bench: $(INSTALLED)
	$(BIN)/python benchmarks

bench-long: $(INSTALLED)
	$(BIN)/python benchmarks/bench_survey.py --long

study: $(INSTALLED)
	$(BIN)/python studies/response

study-faults: $(INSTALLED)
	$(BIN)/python studies/faults

study-coverage: $(INSTALLED)
	$(BIN)/python studies/coverage

study-table: $(INSTALLED)
	$(BIN)/python studies/table

docs: $(INSTALLED)
	rm -rf docs/reference/generated
	$(BIN)/sphinx-build --fresh-env --fail-on-warning --keep-going --quiet -b html docs docs/_build/html
	@echo "docs/_build/html/index.html"

clean:
	rm -rf $(VENV) demo dist docs/_build docs/gallery docs/reference/generated \
		.coverage* .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks docs studies -name __pycache__ -prune -exec rm -rf {} +
