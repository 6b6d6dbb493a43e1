# make demo | test | test-slow | lint | docs | wheels | results: each makes .venv on first use and installs what it needs.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(VENV)/.run
DEV    := $(VENV)/.dev
WORKERS ?= 2
# Oracles of tests whose requirements stay out: opencv-python of trackeval would overwrite opencv-python-headless.
ORACLES := trackeval==1.3.0
# failure_modes_pixels needs a network: mvpose networks get movenet.
STUDIES := angle calibration clocks clutter crowd detector failure_modes failure_modes_pixels look_alike panoptic phantoms repair stress sync tracking views views_corners views_side

PROJECTS := pyproject.toml mvpose/pyproject.toml tools/build_backend.py

.PHONY: demo test test-slow lint docs wheels results clean

demo: $(RUN)
	$(BIN)/simharness run quickstart

# Those marked `slow`, one in nine, take four fifths of the time of all; CI runs both parts.
test: $(DEV)
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal -m "not slow"

test-slow: $(DEV)
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal -m slow

lint: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The site in build/docs; a reference to a name that does not exist is an error.
docs: $(DEV)
	$(BIN)/python -m sphinx -W --keep-going -q -j auto -b html docs build/docs

# dist/mvpose-*.whl and dist/simharness-*.whl; `pip install --find-links dist simharness` installs both. Folders of an
# earlier build are removed first: setuptools would pack the modules that they still hold.
wheels: $(VENV)
	rm -rf dist build/lib build/bdist.* mvpose/build
	$(BIN)/python -m pip wheel --disable-pip-version-check --quiet --no-deps --wheel-dir dist ./mvpose .
	rm -rf build/lib build/bdist.* mvpose/build

# An hour and a half on two cores. Finished trials are kept: it can be stopped, and runs only what the code has changed.
results: $(STUDIES:%=results-%) results-paper results-time results-overview

results-%: $(RUN)
	$(BIN)/simharness study scenarios/$*.toml --workers $(WORKERS)
	$(BIN)/python -m tools.study_digest results/studies/$* results/$*

# Tables 1 and 2 of the paper: of real Shelf where its published files are, and of the twins, which -j2 runs side by side.
# Less than ten minutes a twin: that of Shelf is filmed 5 times a second, at its 25 it would take five times as long.
SHELF ?= ../shared/data/shelf
REAL  := full geometry no-3dps no-matching hungarian fast
TWINS := --seeds 20 --set 'method.variants=["full","appearance","geometry","no-3dps","no-matching","hungarian","fast"]'

.PHONY: results-paper paper-real paper-campus paper-shelf
results-paper: paper-real paper-campus paper-shelf
	$(BIN)/python -m tools.paper_tables --shelf results/shelf/voxelpose.json --shelf-2019 results/shelf/2019.json \
		--campus-twin results/campus/variants.json --shelf-twin results/shelf/variants.json --out results/paper

paper-real: $(RUN)
ifneq ($(wildcard $(SHELF)/calibration_shelf.json),)
	$(BIN)/simharness evaluate shelf $(SHELF) $(REAL:%=--method %) --head voxelpose --json results/shelf/voxelpose.json
	$(BIN)/simharness evaluate shelf $(SHELF) $(REAL:%=--method %) --head 2019 --json results/shelf/2019.json
else
	@echo "no Shelf in $(SHELF): results/shelf/voxelpose.json and 2019.json stay as they are; SHELF=FOLDER says where it is"
endif

paper-campus: $(RUN)
	$(BIN)/python -m tools.paper_tables.seed_scores scenarios/campus.toml $(TWINS) \
		--json results/campus/variants.json > results/campus/variants.txt

paper-shelf: $(RUN)
	$(BIN)/python -m tools.paper_tables.seed_scores scenarios/shelf.toml --set appearance.source=pictures --set rate=5 $(TWINS) \
		--json results/shelf/variants.json > results/shelf/variants.txt

# What a frame costs, beside the paper and the code of others: a minute, on a machine that has nothing else to do.
.PHONY: results-time
results-time: $(RUN)
	$(BIN)/python -m benchmarks.method --only published reid curve --json results/time/bench.json
	$(BIN)/python -m benchmarks.simulator.plot results/time/bench.json results/time

# The picture in the README: a frame of a run, and the curve of the study of crowds.
.PHONY: results-overview
results-overview: results-crowd
	rm -rf results/runs/overview
	$(BIN)/simharness run scenarios/overview.toml --out results/runs/overview
	$(BIN)/python -m tools.readme_picture.picture results/runs/overview/overview-* results/crowd/digest.json results/overview.svg

$(VENV):
	$(PYTHON) -m venv $(VENV)

# Stamps, not the folder, say what is installed: an interrupted install is run again. Modules are compiled when they are
# first imported: most of those of the requirements never are, and all of them take half of the time of the install.
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --no-compile --quiet
$(RUN): $(PROJECTS) | $(VENV)
	$(INSTALL) --editable '.[gl]'
	touch $@

$(DEV): $(PROJECTS) | $(VENV)
	$(INSTALL) --editable '.[dev]'
	$(INSTALL) --no-deps $(ORACLES)
	touch $@ $(RUN)

clean:
	rm -rf $(VENV) build dist mvpose/build *.egg-info mvpose/*.egg-info
