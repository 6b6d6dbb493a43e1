"""A scenario from its trial to what the method is given, in this process and without a word."""

from __future__ import annotations

from simharness.detector.detect import Detected, detect
from simharness.trial.stages.build import Trial
from simharness.trial.stages.frame_tasks import Filming, Reading
from simharness.types.sequence import Sequence
from simharness.world.scene.simulation import simulate


def look(trial: Trial) -> tuple[Sequence, list[Detected]]:
    """Simulate, film, detect, and let networks read where the scenario says so: the truth, and all frames."""
    scenario, sequence = trial.scenario, simulate(trial.scene)
    frames = range(scenario.frames)
    views = Filming(scenario, trial.scene, trial.shots, frozenset())(frames)
    detected = detect(sequence, views, trial.shots.taking, scenario.detector, seed=scenario.seed, looks=trial.looks)
    if Reading.needed(scenario):
        detected = Reading(scenario, trial.scene, trial.shots, tuple(detected))(frames)
    return sequence, detected
