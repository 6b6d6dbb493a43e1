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
    estimate = Estimate.of_joints(PEOPLE, labels=[1, 0, -1], covariance=covariance, ids=[7, 3], timings={"total": 0.5})
    assert estimate.matching.labels_of(3).tolist() == [1, 0, -1]
    np.testing.assert_array_equal(estimate.covariance, covariance)
    assert estimate.timings == {"total": 0.5}
    assert estimate.ids.tolist() == [7, 3]


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


@pytest.mark.parametrize("freedom", [2.5, 4.0, 12.0, None])
@pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
def test_an_ellipsoid_holds_its_share_of_draws(freedom, share):
    """Draws from a multivariate t, or a Gaussian, of the given covariance; 40,000 have a deviation of 0.25 points."""
    rng, n = np.random.default_rng(0), 40_000
    root = np.array([[0.05, 0.0, 0.0], [0.02, 0.03, 0.0], [-0.01, 0.0, 0.01]])
    draws = rng.standard_normal((n, 3)) @ root.T
    if freedom is not None:
        draws *= np.sqrt((freedom - 2) / rng.chisquare(freedom, n))[:, None]
    covariance = np.broadcast_to(root @ root.T, (1, 17, 3, 3))
    given = None if freedom is None else np.full((1, 17), freedom)
    ellipsoid = Estimate(PEOPLE[:1], np.ones((1, 17)), Matching([]), covariance, freedom=given).ellipsoids(share)[0, 3]
    distance = np.einsum("ni,ni->n", draws, np.linalg.solve(ellipsoid, draws.T).T)
    assert np.mean(distance <= 1.0) == pytest.approx(share, abs=0.01)


def test_many_degrees_of_freedom_are_a_gaussian():
    covariance = np.broadcast_to(np.eye(3), (2, 17, 3, 3))
    gaussian = Estimate(PEOPLE, np.ones((2, 17)), Matching([]), covariance)
    nearly = Estimate(PEOPLE, np.ones((2, 17)), Matching([]), covariance, freedom=np.full((2, 17), 1e7))
    np.testing.assert_allclose(nearly.ellipsoids(0.9), gaussian.ellipsoids(0.9), rtol=1e-5)
    assert gaussian.ellipsoids(0.9)[0, 0, 0, 0] == pytest.approx(6.2514, rel=1e-4)  # of tables of chi-square
    assert Estimate.of_joints(PEOPLE).ellipsoids(0.9) is None


def test_degrees_of_freedom_and_shares_are_checked():
    with pytest.raises(ValueError, match="above 2"):
        Estimate(PEOPLE, np.ones((2, 17)), Matching([]), freedom=np.full((2, 17), 2.0))
    for share in (0.0, 1.0, 90, float("nan")):
        with pytest.raises(ValueError, match="above 0 and below 1"):
            Estimate.of_joints(PEOPLE).ellipsoids(share)
