import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose import COCO17
from simharness.detector.detect import detect
from simharness.detector.error_classes import MIRROR, classify, opposite_hits
from simharness.detector.viewing_conditions import Conditions, pixel_offsets
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.truth import KeypointError

GOOD, JITTER, MISS, INVERSION, SWAP, ABSENT = KeypointError


@given(st.floats(0, 12), st.floats(0, 2 * np.pi), st.integers(0, 16), st.integers(0, 1000))
def test_classes_follow_from_distances(far, turn, joint, seed):
    rng = np.random.default_rng(seed)
    target, other, unit = rng.uniform(0, 100, (17, 2)), rng.uniform(0, 100, (17, 2)), rng.uniform(2, 20, 17)
    keypoints = target.copy()
    keypoints[joint] += far * unit[joint] * np.array([np.cos(turn), np.sin(turn)])

    def near(place):
        return np.linalg.norm(keypoints[joint] - place) / unit[joint]

    distance, mirrored, swapped = near(target[joint]), near(target[MIRROR[joint]]), near(other[joint])
    if distance < 1.14:
        expected = GOOD
    elif distance < 2.35:
        expected = JITTER
    elif min(mirrored, swapped) >= 1.14:
        expected = MISS
    else:
        expected = INVERSION if mirrored <= swapped else SWAP
    error = classify(keypoints, target, unit, other=other)
    assert error[joint] == expected
    assert (np.delete(error, joint) == GOOD).all()


@pytest.mark.parametrize(("mirrored", "swapped", "expected"), [(0.3, 0.8, INVERSION), (0.8, 0.3, SWAP)])
def test_the_nearer_of_counterpart_and_neighbour_decides(mirrored, swapped, expected):
    target = np.zeros((17, 2))
    target[8] = [10.0, 0.0]  # the right elbow; the left one is at the origin
    keypoints, other = target.copy(), target + 50.0
    keypoints[7] = target[8] + [mirrored, 0.0]
    other[7] = keypoints[7] + [0.0, swapped]
    assert classify(keypoints, target, np.ones(17), other=other)[7] == expected


def test_joints_not_reported_or_unknown_are_absent():
    target = np.random.default_rng(0).uniform(0, 100, (17, 2))
    keypoints = target.copy()
    keypoints[3] = np.nan
    hidden = target.copy()
    hidden[8] = np.nan
    error = classify(keypoints, hidden, np.full(17, 5.0))
    assert np.flatnonzero(error == ABSENT).tolist() == [3, 8]


def test_isotropic_misses_fall_on_a_place_as_often_as_opposite_to_it():
    rng = np.random.default_rng(0)
    n = 20000
    target = np.zeros((n, 17, 2))
    place = target + [3.0, 2.0]
    turn, far = rng.uniform(0, 2 * np.pi, (n, 17)), rng.uniform(2.35, 4.29, (n, 17))
    keypoints = np.stack([far * np.cos(turn), far * np.sin(turn)], axis=-1)
    error = classify(keypoints, target, np.ones((n, 17)), other=place)
    taken, opposite = (error == SWAP).sum(), opposite_hits(keypoints, target, place, np.ones((n, 17))).sum()
    assert taken > 10000
    assert not opposite_hits(keypoints, target, place, np.ones((n, 17)))[error == SWAP].any()
    assert abs(int(taken) - int(opposite)) < 5 * np.sqrt(taken + opposite)


@pytest.mark.parametrize("seed", [0, 1])
def test_drawn_labels_and_distances_agree(filmed, seed):
    """At least 95 % of the reported joints have the drawn class when classified by distance."""
    config = DetectorSection.model_validate(
        {
            "keypoints": {"scatter": 0.4, "jitter": 0.15, "miss": 0.1, "inversion": 0.06, "swap": 0.06},
            "bias": {"hips": [0.0, 0.01, 0.03]},
        }
    )
    views, conditions = filmed.views, Conditions.of_views(filmed.views)
    target = views.pixels + pixel_offsets(filmed.sequence.joints, config.bias, filmed.rig)
    agree: list[bool] = []
    kinds = set()
    found = detect(filmed.sequence, views, filmed.rig, config, seed=seed)
    for t in range(0, len(found), 8):
        truth, detections = found[t].truth, found[t].detections
        v, p = detections.view, truth.person
        neighbour = conditions.neighbour[t, v, p]
        other = np.where((neighbour >= 0)[:, None, None], target[t, v, neighbour], np.nan)
        classified = classify(detections.keypoints, target[t, v, p], conditions.unit[t, v, p], other=other)
        reported = truth.error != ABSENT
        agree += (classified == truth.error)[reported].tolist()
        kinds |= set(classified[reported].tolist())
    assert kinds == {GOOD, JITTER, MISS, INVERSION, SWAP}
    assert len(agree) > 5000
    assert np.mean(agree) > 0.95


def test_mirror_is_that_of_the_skeleton():
    assert COCO17.joints[MIRROR[COCO17.index("left_knee")]] == "right_knee"
