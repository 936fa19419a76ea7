# Every task of the project, on a machine that has Rust, Python 3.10 or newer, and nothing else installed by hand.
# Python tools live in .venv; results go to target/, dist/ and site/. `make` alone lists the targets.
#
#   PYTHON=python3.12 make venv    which interpreter makes .venv (default: python3)
#   CI=true make test              Cargo.lock is taken as it is; at a desk cargo may update it
#   SDIST=1 make build             the wheel is built by pip out of the source distribution: both are then tried by all
#                                  that tries the wheel

PYTHON ?= python3
CARGO  ?= cargo
VENV   := .venv
PY     := $(VENV)/bin/python
PIP    := $(PY) -m pip --disable-pip-version-check
LOCKED := $(if $(CI),--locked)

# The tests must meet the installed wheel and the tools in .venv, whatever the caller's shell has set.
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV
export PYTHONNOUSERSITE := 1
# pyo3's build script asks an interpreter for its version; without this it would take any python3 on PATH.
export PYO3_PYTHON := $(CURDIR)/$(PY)
# Material for MkDocs prints an advertisement about MkDocs 2 without it.
export NO_MKDOCS_2_WARNING := 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL: # the targets share target/ and .venv, and `test` relies on its order

.PHONY: help
help: ## List the targets
	@awk 'BEGIN { FS = ":.*## " } /^[a-z-]+:.*## / { printf "  make %-18s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# ---------------------------------------------------------------- environment
# A stamp file stands for each installed group, so that repeated calls install nothing.

BASE  := $(VENV)/.stamp-base
BUILD := $(VENV)/.stamp-build
DEV   := $(VENV)/.stamp-dev
COVER := $(VENV)/.stamp-coverage
BENCH := $(VENV)/.stamp-bench

$(BASE):
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || { \
	    echo "ipm_rs needs Python 3.10 or newer; '$(PYTHON)' is: $$($(PYTHON) --version 2>&1)" >&2; \
	    echo "Name another one: make PYTHON=/path/to/python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PIP) install --quiet --upgrade 'pip>=25.1' # the first pip that installs dependency groups (PEP 735)
	@touch $@

$(VENV)/.stamp-%: pyproject.toml $(BASE)
	$(PIP) install --quiet --group $*
	@touch $@

.PHONY: venv
venv: $(BUILD) $(DEV) ## Make .venv with everything that development needs

# ---------------------------------------------------------------- build
# Directories are listed beside files, so that a removed file counts as a change too.

SOURCES := Cargo.toml build.rs pyproject.toml README.md $(wildcard Cargo.lock LICENSE-*) $(shell find src python \
    \( -name __pycache__ -o -name '.?*' \) -prune -o \( -type d -o -name '*.rs' -o -name '*.py' -o -name '*.pyi' -o -name py.typed \) -print)
WHEEL     := dist/.stamp-wheel
INSTALLED := $(VENV)/.stamp-installed

# The source distribution, and whether it holds what make made.
define MAKE_SDIST
rm -rf target/sdist
$(PY) -m maturin sdist --out target/sdist
@if tar tzf target/sdist/ipm_rs-*.tar.gz | grep -E '/(\.venv|target|dist|site)/'; then \
    echo "the source distribution holds files that make made (above): see 'include' in Cargo.toml" >&2; exit 1; fi
endef

# The stamp carries the time at which the build began: a file saved while it ran is built the next time.
$(WHEEL): $(SOURCES) $(BUILD)
	@command -v $(CARGO) >/dev/null || { echo "cargo was not found: install Rust 1.89 or newer first" >&2; exit 1; }
	@mkdir -p dist
	@touch dist/.stamp-begin
	rm -f dist/*.whl python/ipm_rs/*.so python/ipm_rs/*.pyd # a stale extension would win over the new one
ifneq ($(SDIST),)
	$(MAKE_SDIST)
	CARGO_TARGET_DIR=$(CURDIR)/target MATURIN_PEP517_ARGS="--compatibility pypi $(LOCKED)" $(PIP) wheel --quiet --no-deps --wheel-dir dist target/sdist/ipm_rs-*.tar.gz
else
	$(PY) -m maturin build --release --quiet --out dist --interpreter $(PY) $(LOCKED)
endif
	@mv dist/.stamp-begin $@

$(INSTALLED): $(WHEEL)
	$(PIP) uninstall -qq --yes ipm-rs
	$(PIP) install --quiet "$$(ls dist/ipm_rs-*.whl)[cli]"
	@touch $@

.PHONY: build demo
build: $(INSTALLED) ## Build the release wheel into dist/ and install it into .venv
	@ls -l dist/*.whl

demo: $(INSTALLED) ## Build, then render a synthetic road and its bird's-eye view into ipm_demo.png
	$(VENV)/bin/ipm-rs demo

# ---------------------------------------------------------------- checks

# How many of pytest's workers run at once; 0 runs all in one process, which a debugger needs.
WORKERS ?= 2

.PHONY: check test test-source test-wheel lint typecheck test-rust test-properties verify-simd test-python fuzz-api examples snippets bench-smoke
check: lint ## Formatting, lints, unit tests and the fast part of pytest: while working
	$(CARGO) test $(LOCKED) --quiet --lib
	$(MAKE) --no-print-directory test-python ARGS='-q -m "not slow"'

# pytest comes last: its summary is the closing line.
test: test-source test-wheel test-python ## Everything that must pass before a commit

# Two halves that need nothing of each other: .ci/run has them run at once.
test-source: lint test-rust docs # target/debug
test-wheel: verify-simd check-wheel typecheck examples snippets bench-smoke # target/release and .venv

lint: $(DEV) ## Formatting and lints of Rust and Python
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(CARGO) fmt --check
	$(CARGO) fmt --manifest-path fuzz/Cargo.toml --check
	$(CARGO) clippy $(LOCKED) --all-targets -- -D warnings
	$(CARGO) clippy $(LOCKED) --lib --features python -- -D warnings # tests and benches know nothing of it

typecheck: $(DEV) $(INSTALLED) ## mypy over the Python sources, and the stubs against the installed module
	MYPYPATH=python $(PY) -m mypy -p ipm_rs
	$(PY) -m mypy.stubtest ipm_rs._core

# Default features only. `cargo test --features python` would link a test program against CPython's symbols, which an
# extension module leaves to the interpreter that loads it; the binding is tested from Python instead.
# Properties are tried on the same cases each time, so that a change is refused for what it does, not for what chance
# finds in what was there; every night others are tried.
test-rust: ## Rust unit, integration, property and documentation tests
	PROPTEST_RNG_SEED=$(or $(SEED),1) $(CARGO) test $(LOCKED)

test-properties: ## Property tests of Rust on other cases than every day: make test-properties SEED=7 CASES=4096
	PROPTEST_RNG_SEED=$(or $(SEED),$(shell date +%s)) PROPTEST_CASES=$(or $(CASES),2048) $(CARGO) test $(LOCKED) --release

verify-simd: $(WHEEL) ## Disassemble the wheel: every kernel has its instructions, everything else runs on any CPU
	$(PY) -W error scripts/verify_simd.py dist/ipm_rs-*.whl

test-python: $(DEV) $(INSTALLED) ## pytest against the installed wheel
	$(PY) -W error scripts/smoke.py
	$(VENV)/bin/pytest -n $(WORKERS) --dist worksteal $(ARGS)

fuzz-api: $(DEV) $(INSTALLED) ## Call every public name with spoiled arguments: make fuzz-api SEED=1 CALLS=100000
	$(PY) tests/python/api_fuzz.py --seed $(or $(SEED),0) --calls $(or $(CALLS),100000)

examples: $(DEV) $(INSTALLED) ## Run every script of examples/; each asserts its own result
	@set -e; for script in examples/*.py; do echo "$(PY) $$script"; $(PY) -W error $$script; done

snippets: $(DEV) $(INSTALLED) ## Run the Python blocks of the README and of the documentation
	$(PY) -W error scripts/run_snippets.py README.md docs/index.md docs/conventions.md docs/area.md docs/geometry.md docs/refine.md docs/depth.md docs/raster.md docs/rig.md docs/mosaic.md docs/doctor.md docs/cpp.md docs/views.md docs/frames.md docs/fields.md docs/from-opencv.md docs/streams.md docs/ray.md docs/gradients.md docs/tasks docs/datasets

bench-smoke: $(DEV) $(INSTALLED)
	$(PY) benches/python/peers.py --quick

# What takes from minutes to hours, and finds what nobody thought of. Nightly Rust where it is; each says what is missing.
SECONDS ?= 60

.PHONY: test-slow fuzz fuzz-files test-miri test-asan test-memcheck test-memory soak
test-slow: fuzz fuzz-api fuzz-files test-miri test-asan test-memcheck test-memory soak test-neon test-no-avx ## Fuzzers, Miri, sanitizers, soak, other CPUs: an hour or more

fuzz: ## Every fuzz target in turn: make fuzz SECONDS=600 TARGETS="tables lenses"
	$(PYTHON) scripts/fuzz.py --seconds $(SECONDS) $(TARGETS)

fuzz-files: $(DEV) $(INSTALLED) ## Damaged calibrations, points, tables, trajectories and maps: make fuzz-files CALLS=100000
	$(PY) tests/python/calibration_mutations.py $(or $(CALLS),20000) $(or $(SEED),0)
	$(PY) tests/python/point_mutations.py $(or $(CALLS),20000)
	$(PY) tests/python/file_mutations.py $(or $(CALLS),20000) $(or $(SEED),0)

test-miri: ## Miri: views, tables, threads and the merge of rows, at small sizes
	$(PYTHON) scripts/test_checked.py miri

test-asan: ## The Rust tests under AddressSanitizer
	$(PYTHON) scripts/test_checked.py asan

test-memcheck: ## The Rust tests under valgrind's memcheck
	$(PYTHON) scripts/test_checked.py memcheck

test-memory: $(DEV) $(INSTALLED) ## The fast Python tests with Python's own checks of memory: PYTHONMALLOC=debug, -X dev
	PYTHONMALLOC=debug $(PY) -X dev -m pytest -q -m "not slow" -p no:cacheprovider -W ignore::ResourceWarning $(ARGS)

soak: $(DEV) $(INSTALLED) ## Threads, forks, signals and changes of the pool under load: make soak SECONDS=1800
	$(PY) scripts/soak.py --seconds $(SECONDS)

.PHONY: coverage-rust coverage-python
coverage-rust: ## Lines of the core that the Rust tests reach, by cargo-llvm-cov: make coverage-rust ARGS=--html
	PROPTEST_RNG_SEED=1 PROPTEST_CASES=$(or $(CASES),32) $(CARGO) llvm-cov --lib --tests $(or $(ARGS),--summary-only)

coverage-python: $(COVER) $(INSTALLED) ## Lines of the package that pytest reaches, and those that it does not
	rm -rf target/coverage
	$(PY) -m coverage run -m pytest -q -n $(WORKERS) --dist worksteal $(ARGS)
	$(PY) -m coverage combine --quiet
	$(PY) -m coverage report

.PHONY: test-neon test-no-avx
test-neon: ## Cross-compile the Rust tests for aarch64 and run them under qemu; names the packages that it misses
	$(PYTHON) scripts/test_emulated.py neon

test-no-avx: ## Run the Rust tests under qemu on a CPU without AVX and on two without AVX-512
	$(PYTHON) scripts/test_emulated.py no-avx

.PHONY: test-pythons sdist
test-pythons: $(WHEEL) ## Install the wheel with NumPy alone into every Python 3.10+ found here, and try it
	$(PY) scripts/test_pythons.py dist/ipm_rs-*.whl

# Unoptimised: it is to show that the sources are complete, and takes a fifth of the time.
sdist: $(BUILD) ## Build the source distribution, and a wheel from it as pip would
	$(MAKE_SDIST)
	CARGO_TARGET_DIR=$(CURDIR)/target CARGO_PROFILE_DEV_DEBUG=none MATURIN_PEP517_ARGS="--profile dev" $(PIP) wheel --quiet --no-deps --wheel-dir target/sdist target/sdist/ipm_rs-*.tar.gz
	@ls -l target/sdist

# ---------------------------------------------------------------- release

.PHONY: version home check-wheel release-dry
version: ## Set the version everywhere: make version NEW=0.2.0
	$(PYTHON) scripts/release.py bump $(NEW)

home: ## Say everywhere where the source is: make home URL=https://host/owner/ipm_rs
	$(PYTHON) scripts/release.py home $(URL)

check-wheel: $(WHEEL) ## Contents, licences, size, symbols and oldest C library of the wheel
	$(PYTHON) scripts/check_licences.py
	$(PYTHON) scripts/check_wheel.py dist/ipm_rs-*.whl

release-dry: $(BUILD) check-wheel ## What a release does, as far as one machine can: versions, wheel, sdist without a network, crate
	$(PYTHON) scripts/release.py check
	$(MAKE_SDIST)
	$(PYTHON) scripts/build_offline.py $(ARGS) target/sdist/ipm_rs-*.tar.gz
	$(CARGO) publish --dry-run --locked

# ---------------------------------------------------------------- benchmarks, documentation

.PHONY: bench bench-peers bench-instructions docs fmt clean
bench: ## Criterion benchmarks of the Rust core: make bench ARGS="warp"
	$(CARGO) bench $(LOCKED) -- $(ARGS)

bench-peers: $(BENCH) $(INSTALLED) ## Compare with OpenCV and other libraries; rewrites docs/benchmarks.md
	$(PY) benches/python/peers.py --write docs/benchmarks.md

bench-instructions: $(BASE) ## Count instructions a cell (valgrind, AVX2) against benches/instructions.json
	$(PY) scripts/count_instructions.py $(ARGS)

docs: $(DEV) ## Build the documentation into site/, and the Rust documentation into target/doc
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc $(LOCKED) --quiet --no-deps
	$(PY) -m mkdocs build --strict # not --quiet: it hides the warnings, and what is hidden does not fail

fmt: $(DEV) ## Format Rust and Python
	$(CARGO) fmt
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .

clean: ## Remove everything that make made, .venv included
	rm -rf target dist site $(VENV) .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
