"""Distribution of poses in pictures: the shipped file is that of the simulated motions."""

import numpy as np
import pytest

from mvpose import COCO17
from simharness.detector.reported import POSE_BEARINGS, poses_in_pictures
from tools.poses.__main__ import moments
from tools.poses.sample import sample_joints, see

MIRROR = list(COCO17.mirror)


@pytest.fixture(scope="module")
def joints():
    return sample_joints(7, bodies=2, frames=20)


def test_the_shipped_distribution_is_that_of_the_simulated_motions(joints):
    """Other bodies, motions and times: means within a few centimetres, and the same spread of every joint."""
    mean, covariance = moments(see(joints, 7, bearings=POSE_BEARINGS))
    shipped = poses_in_pictures()
    assert np.abs(mean - shipped.mean).max() < 0.06
    spread, expected = (np.sqrt(np.einsum("bii->bi", each)) for each in (covariance, shipped.covariance))
    assert np.abs(spread - expected).max() < 0.08
    assert np.median(spread / expected) == pytest.approx(1.0, abs=0.1)


def test_the_shipped_distribution_is_symmetric():
    shipped = poses_in_pictures()
    flip = np.tile([-1.0, 1.0], 17)
    swapped = np.concatenate([[2 * joint, 2 * joint + 1] for joint in MIRROR])
    opposite = -np.arange(POSE_BEARINGS) % POSE_BEARINGS
    np.testing.assert_allclose(shipped.mean[opposite][:, swapped] * flip, shipped.mean, atol=1e-4)
    mirrored = shipped.covariance[opposite][:, swapped][:, :, swapped] * np.outer(flip, flip)
    np.testing.assert_allclose(mirrored, shipped.covariance, atol=1e-4)
    assert np.linalg.eigvalsh(shipped.covariance).min() > -1e-6


def test_bearings_are_those_of_the_camera_from_the_trunk(joints):
    """A camera on the left side sees the nose to the left of the ears; one behind, the left shoulder on the left."""
    poses = see(joints, 1, bearings=8)
    angle = np.angle(np.exp(1j * (poses.bearing - np.pi / 2)))
    left = poses.places[np.abs(angle) < 0.3]
    facing = left[:, 0, 0] - left[:, 3:5, 0].mean(axis=1)
    assert np.median(facing) < -0.05
    behind = poses.places[np.abs(np.angle(np.exp(1j * (poses.bearing - np.pi)))) < 0.3]
    assert np.median(behind[:, 5, 0] - behind[:, 6, 0]) < -0.2


def test_places_are_projections_of_the_joints(joints):
    """Distances in a picture are never longer than in space, and some camera sees each bone almost in full length."""
    poses = see(joints[:50], 2, bearings=12)
    bone = np.linalg.norm(poses.places[:, 13] - poses.places[:, 11], axis=-1).reshape(2, 50, 12)
    length = np.linalg.norm(joints[:50, 13] - joints[:50, 11], axis=-1)
    right = np.linalg.norm(poses.places[:, 14] - poses.places[:, 12], axis=-1).reshape(2, 50, 12)
    np.testing.assert_allclose(right[1], bone[0], atol=1e-9)  # the mirror image
    assert (bone[0] <= length[:, None] + 1e-9).all()
    assert (bone[0].max(axis=1) > 0.8 * length).all()
