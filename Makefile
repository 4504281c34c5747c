PYTHON ?= python3
BIN := .venv/bin
LAKE ?= lake

.DEFAULT_GOAL := help
.PHONY: help setup test lint

help: ## Show this help
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 16

setup: .venv/.ready ## Make .venv with the pinned packages

.venv/.ready: requirements.lock pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

test: setup lint ## Run the checks and all tests (MOTIONLAKE_DATA: folder of real recordings)
	$(BIN)/python -m pytest

lint: setup ## Run ruff
	$(BIN)/ruff check pipeline jobs sql tests bench
