# make demo    teach, learn, and throw at ten baskets       make demo ARGS="--seed 3 --output /somewhere"
# make test    every test
# make setup   only the environment and the build           make setup PYTHON=python3.12
# make clean   takes away what set-up made
# The first call sets everything up and takes minutes; later ones start in seconds.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.PHONY: demo test setup clean
.DEFAULT_GOAL := demo

# A robot does not announce itself to the building until its user says so.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST

ARGS ?=
PYTHON ?=
ENV := source tools/env.sh

demo: setup
	@$(ENV) && exec dart-skill demo $(ARGS)

test: setup
	@$(ENV) && python3 -m ruff check .
	@$(ENV) && python3 -m pytest tests/unit $(wildcard tests/reference) -n 2
	@$(ENV) && python3 -m pytest tests/integration

# The set-up script runs on any Python from 3.8 on, and looks for the best one itself.
setup:
	@for python in $(PYTHON) python3 python3.11 python3.10 python3.12 python3.13; do \
	  if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 8))' 2>/dev/null; then \
	    exec "$$python" tools/setup_workspace.py $(if $(PYTHON),--python "$(PYTHON)"); \
	  fi; \
	done; \
	echo "set-up stopped: no Python was found; 3.10, 3.11, 3.12 or 3.13 is needed" >&2; exit 1

clean:
	rm -rf .venv build install log
