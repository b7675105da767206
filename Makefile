# One way to run everything. `make help` lists the targets.
#
# Needs Python >= 3.11 and make. Everything else is installed into .venv; optional system parts (a software OpenGL
# device, a browser) come with `make system-deps` and are never needed by `make demo` or `make test`.

VENV := .venv
BIN := $(VENV)/bin
JOBS ?= 2
SHELL := /bin/sh

# The first interpreter that runs and is new enough; `make PYTHON=/path/to/python ...` chooses another one.
PYTHON ?= $(shell for p in python3.11 python3 python3.12 python3.13 python3.14; do \
	if "$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then echo "$$p"; break; fi; done)

PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check
RUNTIME := $(VENV)/.runtime
DEVELOP := $(VENV)/.develop

.PHONY: help venv demo test lint validate bench docs system-deps clean
.DEFAULT_GOAL := help

help:
	@echo 'make demo         render the bundled scenes into out/demo: pictures, EXR files, a contact sheet'
	@echo 'make test         the gate: format, lint, types, import floors, tests (JOBS=$(JOBS) processes)'
	@echo 'make validate     the slow evidence and the docs'
	@echo 'make bench        benchmarks, as ratios within one run: out/bench'
	@echo 'make docs         run the examples in the documentation and check its links'
	@echo 'make system-deps  install the optional system parts (Debian and Ubuntu, uses sudo where needed)'
	@echo 'make venv         the development environment alone;  make clean  removes what the targets made'

$(BIN)/python:
	@if [ -z "$(PYTHON)" ] || ! "$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
		echo 'error: atmoref needs Python 3.11 or newer, and none was found (tried: "$(PYTHON)").' >&2; \
		echo 'Install python3.11 with its venv module, or say: make PYTHON=/path/to/python3.11' >&2; exit 1; fi
	@"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); \
		echo 'error: "$(PYTHON) -m venv" failed; on Debian and Ubuntu the package python3-venv is missing.' >&2; exit 1; }

$(RUNTIME): pyproject.toml | $(BIN)/python
	@echo 'installing atmoref into $(VENV)'
	@$(PIP_INSTALL) --editable .
	@touch $@

$(DEVELOP): pyproject.toml | $(BIN)/python
	@echo 'installing atmoref and its development tools into $(VENV)'
	@$(PIP_INSTALL) --editable '.[test,report]'
	@touch $(RUNTIME) $@

venv: $(DEVELOP)

demo: $(RUNTIME)
	$(BIN)/atmoref demo -o out/demo

lint: $(DEVELOP)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# pytest comes last, so that its own summary is the last thing to read. A test that hangs says where, and fails.
test: lint
	$(BIN)/python -m pytest -W error -m 'not slow' -n $(JOBS) --dist loadfile --timeout=900 -q

docs: $(DEVELOP)
	$(BIN)/python validation/check_links.py README.md CHANGELOG.md luts $(wildcard docs)
	$(BIN)/python -m pytest -W error -q --doctest-glob='*.md' README.md $(wildcard docs)

validate: $(DEVELOP) docs
	$(BIN)/python -m pytest -W error -m slow -q

bench: $(DEVELOP)
	$(BIN)/python validation/bench.py -o out/bench
	$(BIN)/python -m pytest -o addopts= -p no:cacheprovider -p no:xdist tests/bench --benchmark-only -q

# Optional: Mesa's software devices, on which the builds of validation/gl and validation/vulkan run headless; a browser in which the
# reports are opened; an independent reader of KTX2 files under Node.
system-deps:
	@sudo=; if [ "$$(id -u)" != 0 ]; then sudo=sudo; fi; node=; command -v npm >/dev/null || node='nodejs npm'; \
	$$sudo apt-get update && $$sudo apt-get install --yes --no-install-recommends \
		libegl1 libgl1 libgl1-mesa-dri libegl-mesa0 libgles2 libvulkan1 mesa-vulkan-drivers chromium $$node && \
	npm install --silent --no-fund --no-audit --no-save --prefix .node ktx-parse@1

clean:
	rm -rf $(VENV) .node out build dist .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
