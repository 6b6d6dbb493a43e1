# make demo | test | lint : each makes .venv on first use and installs what it needs.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(VENV)/.run
DEV    := $(VENV)/.dev

.PHONY: demo test lint clean

demo: $(RUN)
	$(BIN)/simharness run scenarios/quickstart.toml

test: $(DEV)
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(VENV):
	$(PYTHON) -m venv $(VENV)

# Stamps, not the folder, say what is installed: an interrupted install is run again.
$(RUN): pyproject.toml | $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable .
	touch $@

$(DEV): pyproject.toml | $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check --quiet --editable '.[dev]'
	touch $@ $(RUN)

clean:
	rm -rf $(VENV)
