"""The same draws under other conditions: what a condition does not change is the same object or the same numbers."""

import numpy as np
import pytest

from mvpose import preset
from mvpose.skeleton import COCO17
from simharness.scenario.load import load
from simharness.scenario.sections.cameras_section import FaultsSection
from simharness.scoring.stage_blame import true_labels
from simharness.trial.conditioned_trial import ConditionedTrial, estimate_frames
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.build_trial import build_trial
from simharness.types.views import Visibility

OVERRIDES = (
    "people.count=3",
    "duration=0.3",
    "cameras.count=3",
    'rendering.renderer="rays"',
    'method.variants=["fast"]',
)


@pytest.fixture(scope="module")
def scenario():
    return load("quickstart", overrides=OVERRIDES)


@pytest.fixture(scope="module")
def draws(scenario):
    return ConditionedTrial(build_trial(scenario))


def with_faults(scenario, **faults):
    return scenario.model_copy(update={"faults": FaultsSection(**faults)})


def keypoints(detected):
    return np.concatenate([each.detections.keypoints for each in detected.frames])


def test_without_a_change_it_is_the_trial(draws, scenario):
    found, expected = draws.detected(scenario), run_trial(scenario, until="estimate")
    np.testing.assert_array_equal(keypoints(found), keypoints(expected.detected))
    estimates = estimate_frames(preset("fast"), found.rig, [each.detections for each in found.frames])
    for one, other in zip(estimates, expected.estimates["fast"], strict=True):
        np.testing.assert_array_equal(one.joints, other.joints)


def test_a_wrong_calibration_changes_no_picture_and_no_detection(draws, scenario):
    plain, turned = draws.detected(scenario), draws.detected(with_faults(scenario, rotation=2.0))
    np.testing.assert_array_equal(keypoints(plain), keypoints(turned))
    assert all(not np.allclose(one.R, other.R) for one, other in zip(plain.rig, turned.rig, strict=True))


def test_late_pictures_are_taken_again_and_only_once(draws, scenario):
    late = with_faults(scenario, clock_offset=0.1)
    assert not np.array_equal(keypoints(draws.detected(late)), keypoints(draws.detected(scenario)))
    trial = build_trial(late)
    assert draws.views(trial.exposures) is draws.views(trial.exposures)


def test_revealed_joints_are_detected_and_stay_hidden_in_the_truth(draws, scenario):
    hidden = [Visibility.OCCLUDED_BY_PERSON, Visibility.OCCLUDED_BY_CLUTTER]
    plain, revealed = draws.detected(scenario), draws.detected(scenario, revealed=hidden)
    for one, other in zip(plain.frames, revealed.frames, strict=True):
        np.testing.assert_array_equal(one.truth.visibility, other.truth.visibility)
    assert len(keypoints(revealed)) >= len(keypoints(plain))
    assert not np.array_equal(keypoints(plain), keypoints(revealed))


def test_labels_take_the_place_of_the_matching(draws, scenario):
    found = draws.detected(scenario)
    labels = [true_labels(each.detections, each.truth) for each in found.frames]
    given = [each.detections for each in found.frames]
    for label, estimate in zip(labels, estimate_frames(preset("full"), found.rig, given, labels=labels), strict=True):
        np.testing.assert_array_equal(estimate.matching.labels, label)
        assert estimate.joints.shape[1:] == (len(COCO17), 3)
    with pytest.raises(ValueError, match="takes no labels"):
        estimate_frames(preset("track"), found.rig, given, labels=labels)
