"""Pairs of tracklets whose lines of sight meet: the evidence grows with the joints that both have."""

import numpy as np
import pytest

from mvpose.calibration.tracklet_matching import _score_pairs

CENTERS = np.array([[4.0, 0.0, 1.0], [0.0, 4.0, 1.5]])


def score(frames: int, joints: int) -> tuple[float, float]:
    """Return the score of one person in two pictures at each time, and the largest entry of the normal matrix."""
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (frames, joints, 3))
    rows = np.concatenate([points - CENTERS[0], points - CENTERS[1]])
    rows /= np.linalg.norm(rows, axis=-1, keepdims=True)
    gains, left, _ = _score_pairs(
        np.array([[0, 1]]), np.array([0, frames, 2 * frames]), np.tile(np.arange(frames), 2),
        np.repeat([0, 1], frames), CENTERS, rows, np.zeros_like(rows), np.full(rows.shape[:2], 0.002),
        1e-4 * np.eye(14),
    )  # fmt: skip
    return float(gains[0]), float(np.abs(left).max())


@pytest.mark.parametrize(("frames", "joints"), [(11, 1), (5, 2), (1, 11)])
def test_fewer_than_twelve_joints_in_common_are_no_evidence(frames, joints):
    assert score(frames, joints) == (0.0, 0.0)


@pytest.mark.parametrize(("frames", "joints"), [(12, 1), (6, 2), (1, 12)])
def test_lines_of_sight_that_meet_are_evidence_for_one_person_from_twelve_joints_on(frames, joints):
    gain, information = score(frames, joints)
    assert gain > 0.0 < information
    assert score(2 * frames, joints)[0] > gain
