# make sweep | test | check | docs | gallery | bench: each sets up what it needs first. Paths are relative, so spaces above do no harm.
PYTHON ?= python3
PY := .venv/bin/python
PIP := $(PY) -m pip install --quiet --disable-pip-version-check --constraint constraints.txt
EPISODES ?= 10
WORKERS ?= $(shell nproc 2>/dev/null || echo 2)
OUT ?= out/sweep
SHARE ?= 1
FIRST ?= 0

ifeq ($(MAKELEVEL),0)
.NOTPARALLEL:  # two goals at once (make -j docs gallery) would let two pips write into .venv
endif

.PHONY: help setup sweep test lint types contracts check format docs gallery bench fuzz soak clean

help:
	@echo "make sweep   sweep the shipped scenarios with eight agents, by rules and learnt: $(OUT)/metrics.csv and a table"
	@echo "make test    run the tests"
	@echo "make check   tests, lint, types, import contracts"
	@echo "make docs    the documentation: out/docs/index.html"
	@echo "make gallery all scenarios, what agents do in them, reports of results: out/gallery/index.html"
	@echo "make bench   the benchmarks, as ratios"
	@echo "make fuzz    damaged inputs of every sort; SHARE=0.01 of them, from FIRST=0.5 on: out/fuzz/fuzz.md"
	@echo "make soak    20,000 episodes, SHARE=0.02 of them: are memory, speed and open files flat?"
	@echo "make clean   remove .venv, build, dist and, in out/, docs, gallery and fuzz; sweeps and trainings stay"

setup: .venv/.ready

.venv/.made:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' || \
		{ echo "RUDC needs Python 3.11, 3.12 or 3.13; name one: make PYTHON=python3.12 $(MAKECMDGOALS)" >&2; exit 2; }
	$(PYTHON) -m venv .venv
	@touch $@

# what the kernels need, numba and (if there is any) scipy, comes first: they are compiled while pip brings the rest
.venv/.numba: .venv/.made pyproject.toml constraints.txt
	$(PIP) numba scipy
	@touch $@

.venv/.kernels: .venv/.numba
	$(PY) -m rudc.evaluation.compiled
	@touch $@

.venv/.core: .venv/.numba
	$(PIP) --editable .
	$(PY) -m compileall -q rudc
	@touch $@

.venv/.ready: .venv/.numba
	@$(MAKE) --no-print-directory --jobs=2 .venv/.core .venv/.kernels  # at once, since pip uses one core only
	@touch $@

.venv/.tools: .venv/.core
	$(PIP) --editable ".[dev]"
	@touch $@

.venv/.dev: .venv/.numba
	@$(MAKE) --no-print-directory --jobs=2 .venv/.tools .venv/.kernels
	@touch $@

.venv/.docs: .venv/.core
	$(PIP) --editable ".[docs]"
	@touch $@

.venv/.bench: .venv/.dev
	$(PIP) --editable ".[bench]"
	@touch $@

sweep: .venv/.ready
	$(PY) -m rudc sweep --shipped --episodes $(EPISODES) --seed 0 --workers $(WORKERS) --out "$(OUT)" --resume

test: .venv/.dev
	$(PY) -m pytest -n $(WORKERS) --dist worksteal

lint: .venv/.tools
	$(PY) -m ruff format --check .
	$(PY) -m ruff check .

types: .venv/.tools
	$(PY) -m pyright

contracts: .venv/.tools
	$(PY) -c "from importlinter.cli import lint_imports_command; lint_imports_command()"

check: .venv/.numba
	@$(MAKE) --no-print-directory --jobs=2 lint types contracts .venv/.kernels  # one core each
	@$(MAKE) --no-print-directory test

format: .venv/.dev
	$(PY) -m ruff format .
	$(PY) -m ruff check --fix .

docs: .venv/.docs
	NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --quiet --clean
	@echo "out/docs/index.html written"

gallery: .venv/.ready
	$(PY) -m rudc.reporting.gallery out/gallery results/ood results/tasks

bench: .venv/.bench
	$(PY) -m tests.benchmarks

fuzz: .venv/.dev
	$(PY) -m tests.fuzz --share $(SHARE) --first $(FIRST) --workers $(WORKERS)

soak: .venv/.dev
	$(PY) -m tests.benchmarks.soak --share $(SHARE) --workers $(WORKERS)

clean:
	rm -rf .venv build dist out/docs out/gallery out/fuzz
