# Everything runs in .venv, which the first target that needs it makes from requirements.lock.
# Needs python3 >= 3.11, git and make. Another interpreter: make PYTHON=python3.12 ...
# Arguments for a program: make demo ARGS="birotor --for 20"

.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/installed
ARGS ?=

.PHONY: help
help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# --no-build-isolation: the build backend comes from the lock too, so nothing is installed that it does not name.
$(STAMP): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	  echo "python: $$($(PYTHON) --version 2>&1 || true), 3.11 or newer is needed; say make PYTHON=python3.12, or install it" >&2; exit 2; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "python: $(PYTHON) has no venv or ensurepip, both are needed; install python3-venv" >&2; exit 2; }
	@echo "setting up $(VENV) (once, and when requirements.lock changes)"
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

.PHONY: venv
venv: $(STAMP) ## the environment alone

.PHONY: demo
demo: $(STAMP) ## a simulated mini car, the daemon, and both closing the loop over Zenoh
	$(BIN)/fusiond demo $(ARGS)

.PHONY: test
test: $(STAMP) ## every test
	$(BIN)/python -m pytest $(ARGS)

.PHONY: lint
lint: $(STAMP) ## style, types and import contracts
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

.PHONY: check
check: lint ## what CI runs: lint, then every test
	$(BIN)/python -m pytest

.PHONY: bench
bench: $(STAMP) ## the figures of docs/benchmarks.md, measured here; ends with one JSON object
	@$(BIN)/python -m tools.bench $(ARGS)

.PHONY: scoreboard
scoreboard: $(STAMP) ## how fast and how surely faults are found, over the limit; ends with one JSON object
	@$(BIN)/python -m tools.scoreboard $(ARGS)

.PHONY: chaos
chaos: $(STAMP) ## sensors that lie at random on streams in disorder: what must hold whatever happens, and what is counted
	@$(BIN)/python -m tools.chaos $(ARGS)

# Made on the oldest Python supported, where most packages are needed; the marker lets newer ones leave one out.
.PHONY: lock
lock: ## requirements.lock anew, from the newest versions that pyproject.toml allows (use python3.11)
	@set -eu; fresh=$$(mktemp -d); trap 'rm -rf "$$fresh"' EXIT; \
	$(PYTHON) -m venv "$$fresh/venv"; \
	"$$fresh/venv/bin/python" -m pip install --quiet --disable-pip-version-check '.[test,dev]'; \
	"$$fresh/venv/bin/python" -m pip freeze --all --disable-pip-version-check > "$$fresh/all"; \
	sed -e '/^pip[ =]/d' -e '/^fusiond[ =]/d' -e 's/^\(backports.zstd==.*\)/\1; python_version < "3.14"/' \
	  "$$fresh/all" > requirements.lock

.PHONY: clean
clean: ## remove what make made; the caches of compiled steps stay
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find fusiond tests tools -name __pycache__ -prune -exec rm -rf {} +
