# make demo | test | lint | results : each makes .venv on first use and installs what it needs.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(VENV)/.run
DEV    := $(VENV)/.dev
WORKERS ?= 2
STUDIES := angle calibration clutter crowd detector look_alike panoptic phantoms stress sync views

.PHONY: demo test lint results clean

demo: $(RUN)
	$(BIN)/simharness run scenarios/quickstart.toml

test: $(DEV)
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# An hour on two cores. Finished trials are kept: it can be stopped, and runs only what the code has changed.
results: $(STUDIES:%=results-%)

results-%: $(RUN)
	$(BIN)/simharness study scenarios/$*.toml --workers $(WORKERS)
	$(BIN)/simharness report results/studies/$* --digest results/$*

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
