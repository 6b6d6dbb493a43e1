"""Commands of ``simharness`` that reuse the simulations of an earlier run.

Building and filming the scenes takes most of the time of the gate. A bug in the method or in a score cannot change
them, so the run without bugs keeps them, and the runs with bugs begin at the first stage that a bug can change.
"""

from __future__ import annotations

import hashlib
import pickle
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from mvpose.commands.progress import Stages
from mvpose.files.atomic_files import write_atomic
from simharness.scenario.sections.scenario import Scenario
from simharness.trial import run_trial
from simharness.trial.stages.detected_sequence import DetectedSequence
from simharness.trial.stages.simulation import Simulation, detect_trial

First = Literal["scenes", "detections", "estimates"]
"""First stage that a change of code can affect: all of them, detections in filmed scenes, or estimates and scores."""

_METHOD = ("affinity", "matching", "reconstruction", "tracking", "rays.py", "duplicates.py", "pipeline.py")
_AFTER = ("scoring", "statistics", "gate")
AFTER_DETECTION = (*(f"mvpose/{name}" for name in _METHOD), *(f"simharness/{name}" for name in _AFTER))
"""Files and folders that no module of simulation and detection imports; a test checks it."""


def first_stage(file: str) -> First:
    """Return the first stage that a change of a file, relative to the checkout, can affect."""
    if any(file == each or file.startswith(f"{each}/") for each in AFTER_DETECTION):
        return "estimates"
    return "detections" if file.startswith("simharness/detector/") else "scenes"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``FOLDER FIRST KEEP COMMAND ...``: a command of ``simharness`` with the simulations in a folder.

    FIRST is the first stage to run (:data:`First`); KEEP is "keep" to add missing simulations, else "use".
    """
    folder, first, keep, *command = sys.argv[1:] if arguments is None else arguments
    original = run_trial._simulate

    def simulate(
        scenario: Scenario, stages: Stages, workers: int, previews: Collection[int], compile_ahead: bool, every: int
    ) -> tuple[Simulation, DetectedSequence, Mapping[str, Any]]:
        path = Path(folder) / f"{_digest(scenario)}.pickle"
        if first == "scenes" or not path.is_file():
            simulation, detected, pipelines = original(scenario, stages, workers, previews, compile_ahead, every)
            if keep == "keep":
                path.parent.mkdir(parents=True, exist_ok=True)
                write_atomic(path, pickle.dumps((_without_scene(simulation), detected)))
            return simulation, detected, pipelines
        filmed, detected = pickle.loads(path.read_bytes())
        if first == "detections":
            detected = detect_trial(filmed, stages)
        pipelines = run_trial.build_variants(scenario)
        return replace(filmed, trial=replace(filmed.trial, pipelines=pipelines)), detected, pipelines

    run_trial._simulate = simulate
    from simharness.cli import main as simharness

    sys.argv = ["simharness", *command]
    return simharness() or 0  # type: ignore[func-returns-value]


def _digest(scenario: Scenario) -> str:
    text = scenario.model_dump_json(exclude={"name", "description", "method"})
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def _without_scene(simulation: Simulation) -> Simulation:
    """Return a simulation without what detection does not need: meshes and the physical model are large."""
    return replace(simulation, trial=replace(simulation.trial, scene=None, pipelines={}))  # type: ignore[arg-type]


if __name__ == "__main__":
    sys.exit(main())
