"""Estimates made from joints only."""

import numpy as np
import pytest
from people import crowd

from mvpose import COCO17, SHELF14, Estimate
from mvpose.estimate import Matching

PEOPLE = crowd(2)


def test_joints_alone_are_an_estimate():
    estimate = Estimate.of_joints(PEOPLE.tolist())
    np.testing.assert_array_equal(estimate.joints, PEOPLE)
    assert (estimate.scores == 1).all()
    assert estimate.covariance is None
    assert not estimate.matching.covers(3)
    assert estimate.matching.labels_of(3).tolist() == [-1, -1, -1]


@pytest.mark.parametrize("skeleton", [COCO17, SHELF14])
def test_no_people_is_an_empty_list(skeleton):
    estimate = Estimate.of_joints([], scores=[], labels=[-1, -1], skeleton=skeleton)
    assert estimate.joints.shape == (0, len(skeleton), 3)
    assert estimate.scores.shape == (0, len(skeleton))
    assert estimate.matching.labels_of(2).tolist() == [-1, -1]


@pytest.mark.parametrize("missing", [[None] * 3, [np.nan] * 3, [0.1, None, 0.3], [np.inf, 0.0, 0.0]])
def test_a_missing_joint_is_nan_with_score_0(missing):
    joints = PEOPLE.tolist()
    joints[1][4] = missing
    estimate = Estimate.of_joints(joints, scores=np.full((2, 17), 0.7))
    assert np.argwhere(np.isnan(estimate.joints)).tolist() == [[1, 4, 0], [1, 4, 1], [1, 4, 2]]
    assert estimate.scores[1, 4] == 0
    assert np.count_nonzero(estimate.scores == 0.7) == 33


def test_scores_of_people_are_those_of_their_joints():
    estimate = Estimate.of_joints(PEOPLE, scores=[0.2, 0.9])
    assert (estimate.scores == [[0.2]] * 1 + [[0.9]] * 1).all()


def test_optional_fields_are_kept():
    covariance = np.broadcast_to(np.eye(3), (2, 17, 3, 3))
    estimate = Estimate.of_joints(PEOPLE, labels=[1, 0, -1], covariance=covariance, timings={"total": 0.5})
    assert estimate.matching.labels_of(3).tolist() == [1, 0, -1]
    np.testing.assert_array_equal(estimate.covariance, covariance)
    assert estimate.timings == {"total": 0.5}


@pytest.mark.parametrize(
    ("joints", "more", "message"),
    [
        (PEOPLE[:, :14], {}, r"joints must be \(n, 17, 3\), got \(2, 14, 3\)"),
        (PEOPLE[0], {}, r"joints must be \(n, 17, 3\), got \(17, 3\)"),
        (PEOPLE, {"scores": [1.0]}, r"scores must be \(2,\), got \(1,\)"),
        (PEOPLE, {"scores": np.ones((2, 14))}, r"scores must be \(2, 17\), got \(2, 14\)"),
        (PEOPLE, {"scores": [0.5, 37.0]}, r"scores must lie in 0..1, got 0.5 to 37"),
        (PEOPLE, {"scores": [0.5, np.nan]}, r"scores must lie in 0..1"),
        (PEOPLE, {"labels": [0, 2]}, r"labels must be -1, or 0 to n - 1 of n = 2 people, got 0 to 2"),
        (PEOPLE, {"labels": [0, -2]}, r"labels must be -1, or 0 to n - 1 of n = 2 people, got -2 to 0"),
        ([], {"labels": [0]}, r"of n = 0 people"),
        (PEOPLE, {"covariance": np.eye(3)}, r"covariance must be \(2, 17, 3, 3\), got \(3, 3\)"),
    ],
)
def test_invalid_fields_are_refused(joints, more, message):
    with pytest.raises(ValueError, match=message):
        Estimate.of_joints(joints, **more)


def test_labels_cover_all_detections_or_none():
    assert Matching([0, -1]).labels_of(2).tolist() == [0, -1]
    assert Matching([0, -1]).covers(2)
    assert Matching([]).covers(0)
    with pytest.raises(ValueError, match=r"labels must be \(3,\), got \(2,\)"):
        Matching([0, -1]).labels_of(3)
