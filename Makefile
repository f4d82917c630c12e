# make demo    teach, learn, and throw at ten baskets       make demo ARGS="--seed 3 --output /somewhere"
# make test    the tests, but for some that take long; prints the 20 slowest
# make test-all  every test
# make test-oldest  unit tests of the library with the oldest NumPy, SciPy and Matplotlib that it takes
# make setup   only the environment and the build           make setup PYTHON=python3.12
# make docs    the documentation as a website in build/docs, with a report of throws; a broken link is an error
# make linkcheck  do the links to other sites still lead somewhere? needs the internet
# make benchmark  speed beside other libraries, in an environment of its own; takes minutes, wants a quiet machine
# make growth  the curves of docs/performance.md: bags to 10 GB, 20 graphs, all cores; takes an hour, 25 GB of disk, 10 GB of memory
# make lock    requirements/lock.txt anew: the newest versions that the requirements allow, with their hashes
# make clean   takes away what set-up made
# The first call sets everything up and takes minutes; later ones start in seconds.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.PHONY: demo test test-all test-oldest setup docs linkcheck benchmark growth lock clean
.DEFAULT_GOAL := demo

# A robot does not announce itself to the building until its user says so.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

# Every node and every test of a command is a process: without byte code each would compile all that it imports anew.
unexport PYTHONDONTWRITEBYTECODE

ARGS ?=
PYTHON ?=
ENV := source tools/env.sh

demo: setup
	@$(ENV) && exec dart-skill demo $(ARGS)

# In this order, in one go, with more workers than cores: while a test of nodes waits, others compute, and no long one begins last.
# A file in which something failed is tried again, alone: a busy machine may be late by more than a limit.
TESTS := tests/integration tests/foreign_arm tests/reference tests/unit

# Types are checked beside the tests, for mypy uses one core only; what it says comes at the end.
define run_tests
	@$(ENV) && python3 -m ruff check .
	@$(ENV) && { python3 -m mypy > build/types.txt 2>&1 & } && { python3 -m pytest $(TESTS) $(1) -n 3 --dist loadfile --no-loadscope-reorder --durations=20 || \
	  { [ $$? = 1 ] && python3 tools/try_again.py $(1); }; } && wait $$! && tail -n 1 build/types.txt || { cat build/types.txt; exit 1; }
endef

# Three tests in a hundred take more than half of the time; each goes a long way where another goes a short one (docs/development.md).
test: setup
	$(call run_tests,-m "not slow")

test-all: setup
	$(call run_tests)

# Without ROS and without what needs a newer NumPy; last bits differ from those of NumPy 2.
OLDEST := numpy==1.26.4 scipy==1.11.4 matplotlib==3.7.5
OF_LIBRARY := $(addprefix tests/unit/,arm common darts experiments figures mixture movement policy_search recording simulation skills)

test-oldest: setup
	@.venv/bin/python3 -m venv build/oldest
	@build/oldest/bin/python3 -m pip install --quiet --disable-pip-version-check -r requirements/runtime.txt -r requirements/oldest.txt $(OLDEST)
	@build/oldest/bin/python3 -m pytest $(OF_LIBRARY) -m "not slow" -n 2 --dist loadfile

# The set-up script runs on any Python from 3.8 on, and looks for the best one itself.
setup:
	@for python in $(PYTHON) python3 python3.11 python3.10 python3.12 python3.13; do \
	  if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 8))' 2>/dev/null; then \
	    exec "$$python" tools/setup_workspace.py $(if $(PYTHON),--python "$(PYTHON)"); \
	  fi; \
	done; \
	echo "set-up stopped: no Python was found; 3.10, 3.11, 3.12 or 3.13 is needed" >&2; exit 1

docs: setup
	@$(ENV) && python3 -m sphinx -W --keep-going -q -b html docs build/docs
	@rm -f build/docs/report.html && $(ENV) && dart-skill report bags/throws --output build/docs/report.html > /dev/null
	@echo "build/docs/index.html"

linkcheck: setup
	@$(ENV) && python3 -m sphinx -q -t prose -b linkcheck docs build/linkcheck

BENCHMARK_PYTHON := .venv-benchmark/bin/python3

WITH_PEERS := mixtures primitives recording few_samples growth power
OF_THE_ARM := skill.lessons skill.waits skill.cores graph.loop graph.player graph.recorder graph.side_by_side graph.large_bags

# Rows of all scripts, for one table at the end.
benchmark: export BENCHMARK_ROWS := $(CURDIR)/build/benchmark.jsonl
benchmark: .venv-benchmark/installed
	@rm -f "$$BENCHMARK_ROWS"
	@for name in $(WITH_PEERS); do echo; echo "== $$name"; $(BENCHMARK_PYTHON) -m benchmarks.$$name || exit 1; done
	@$(ENV) && for name in $(OF_THE_ARM); do echo; echo "== $$name"; python3 -m benchmarks.$$name || exit 1; done
	@echo; python3 -m benchmarks.rows "$$BENCHMARK_ROWS"

.venv-benchmark/installed: requirements/benchmark.txt | setup
	@.venv/bin/python3 -m venv .venv-benchmark
	@$(BENCHMARK_PYTHON) -m pip install --quiet --disable-pip-version-check -r requirements/benchmark.txt
	@touch $@

SIZES ?= 0.1 0.3 1 3 10

growth: setup
	@mkdir -p build/growth
	@$(ENV) && python3 -m benchmarks.growth --picture docs/growth.svg
	@$(ENV) && python3 -m benchmarks.skill.cores --results build/growth/cores.json
	@$(ENV) && python3 -m benchmarks.graph.side_by_side --graphs 1 2 4 8 12 20 --results build/growth/graphs.json
	@$(ENV) && python3 -m benchmarks.graph.large_bags --sizes $(SIZES) --results build/growth/bags.json
	@$(ENV) && python3 tools/draw_growth.py build/growth docs/growth_graphs.svg

# For every Python and platform at once. Which version of uv does it makes no difference to what is locked.
LOCKED := $(addprefix requirements/,build.txt runtime.txt test.txt ros-pypi.txt)

lock:
	@$(or $(PYTHON),python3) -m venv build/lock && build/lock/bin/python3 -m pip install --quiet --disable-pip-version-check uv
	@build/lock/bin/uv pip compile --quiet --upgrade --universal --python-version 3.10 --generate-hashes --no-annotate --no-emit-index-url \
	  --custom-compile-command "make lock" --output-file requirements/lock.txt $(LOCKED)

clean:
	rm -rf .venv .venv-benchmark build install log
	find dart_skill -name '*.so' -delete
