"""Errors of joints: distances, bone lengths and jitter."""

import numpy as np
import pytest
from recordings import PERSON, walk
from scipy.spatial.transform import Rotation

from mvpose import COCO17
from simharness.scoring.joint_errors import bone_errors, jitter, joint_errors

TRUTH = walk(20, 2)


def test_a_missing_estimate_is_infinitely_far_and_a_missing_truth_is_nan():
    truth, estimate = np.zeros((2, 3)), np.zeros((2, 3))
    truth[0, 2], estimate[1] = np.nan, np.nan
    np.testing.assert_array_equal(joint_errors(truth, estimate), [np.nan, np.inf])


def test_rigid_motion_changes_no_bone():
    moved = Rotation.from_rotvec([0.3, -0.5, 1.0]).apply(PERSON) + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(bone_errors(PERSON, moved), np.zeros(16), atol=1e-12)


def test_bones_scale_with_the_person():
    lengths = [np.linalg.norm(PERSON[child] - PERSON[parent]) for parent, child in COCO17.edges]
    np.testing.assert_allclose(bone_errors(PERSON, 1.1 * PERSON), 0.1 * np.array(lengths))
    np.testing.assert_allclose(bone_errors(PERSON, 0.9 * PERSON), -0.1 * np.array(lengths))


@pytest.mark.parametrize("missing", ["left_wrist", "left_shoulder"])
def test_bones_of_a_missing_joint_are_nan(missing):
    estimate = PERSON.copy()
    estimate[COCO17.index(missing)] = np.nan
    bones = [COCO17.index(missing) in edge for edge in COCO17.edges]
    np.testing.assert_array_equal(np.isnan(bone_errors(PERSON, estimate)), bones)
    assert any(bones)


def test_a_perfect_track_of_moving_people_has_no_jitter():
    assert (np.linalg.norm(np.diff(TRUTH, n=2, axis=0), axis=-1) > 1e-4).any()  # people turn
    assert jitter(TRUTH, TRUTH).shape == (18, 2, 17)
    assert (jitter(TRUTH, TRUTH) == 0).all()


def test_neither_an_offset_nor_a_uniform_drift_is_jitter():
    drift = np.arange(20)[:, None, None, None] * np.array([0.01, -0.02, 0.0])
    np.testing.assert_allclose(jitter(TRUTH, TRUTH + 0.1 + drift), 0, atol=1e-12)


def test_white_noise_has_the_jitter_of_the_closed_form():
    rng, sigma = np.random.default_rng(0), 0.02
    truth = np.zeros((3, 200_000, 3))
    values = jitter(truth, sigma * rng.standard_normal(truth.shape))
    assert values.mean() == pytest.approx(sigma * np.sqrt(6) * np.sqrt(8 / np.pi), rel=0.01)
    assert np.sqrt((values**2).mean() / 3) == pytest.approx(sigma * np.sqrt(6), rel=0.01)  # along each axis


def test_jitter_is_nan_in_the_frames_around_a_gap():
    estimate = TRUTH.copy()
    estimate[5, 0] = np.nan
    unknown = np.isnan(jitter(TRUTH, estimate))
    assert np.flatnonzero(unknown[:, 0].all(axis=1)).tolist() == [3, 4, 5]
    assert not unknown[:, 1].any()


@pytest.mark.parametrize("frames", [1, 2])
def test_fewer_than_three_frames_have_no_jitter(frames):
    assert jitter(TRUTH[:frames], TRUTH[:frames]).shape == (0, 2, 17)
