"""The comparison of a profile with its network, on simulated detectors in the place of networks."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.network_profile.profile_check import CheckedFigure, check_profile
from mvpose.commands.progress import Silence, Stages
from simharness.scenario.load import load_study
from simharness.scenario.sections.detector_section import KINDS, DetectorSection
from simharness.statistics.intervals import Interval
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import capture_trial
from tools.network_profile.profiled_scenes import ProfiledScene

NO_BIAS = np.zeros((len(KINDS), 3))
ERRING = {
    "kind": "top-down",
    "keypoints": {"scatter": 0.4, "jitter": 0.1, "miss": 0.06, "swap": 0.03, "guess": {"outside": 1.0}},
    "scores": {"good": 0.8, "miss": 0.3, "deviation": 0.3},
    "boxes": {"missed": 0.1, "duplicates": 0.05},
    "phantoms": {"rate": 0.3},
}


@pytest.mark.slow
def test_the_same_detector_holds_and_another_fails():
    """The check is passed by the very draws of the network, and failed by a detector that misses nearly everybody."""
    short = ["duration=0.8", 'rendering.renderer="rays"', "people.count=2", "clutter.boxes=0"]
    study = load_study("quickstart", overrides=[*short, 'method.variants=["fast"]'])
    right = DetectorSection.model_validate(ERRING)
    wrong = right.model_copy(update={"boxes": right.boxes.model_copy(update={"missed": 0.97})})
    scenes = []
    for seed in range(4):
        trial = build_trial(study.at(study.settings[0], seed))
        film = capture_trial(trial, Stages(Silence()))
        rigs = trial.exposures.true_rig, trial.exposures.believed_rig
        scene = ProfiledScene("", trial.scenario, film.sequence, film.views, *rigs, ())
        scenes.append(replace(scene, found=scene.simulated(right)))
    check = check_profile(scenes, {"right": right, "wrong": wrong}, kind="top-down", bias=NO_BIAS)
    score = check.score("right", "fast", "pcp")
    assert score.difference.mean == 0
    assert score.verdict == "holds"
    assert check.score("wrong", "fast", "pcp").verdict == "fails"
    assert set(check.verdicts["subsets of cameras"]) == {"holds"}
    assert check.summary()["detectors"]["wrong"]["scores"]["fast"]["pcp"]["verdict"] == "fails"


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (-1.9, 1.9, "holds"),
        (-1.0, 2.1, "cannot tell"),
        (2.1, 3.0, "fails"),
        (-5.0, -2.1, "fails"),
        (-3.0, 3.0, "cannot tell"),
    ],
)
def test_a_verdict_is_about_the_whole_interval(low, high, verdict):
    assert CheckedFigure(90.0, Interval((low + high) / 2, low, high, 10), 2.0).verdict == verdict
