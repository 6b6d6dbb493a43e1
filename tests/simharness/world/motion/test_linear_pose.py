"""Derivatives of joints and feet by the pose, beside finite differences."""

import numpy as np
import pytest
from casting import performer
from scipy.spatial.transform import Rotation

from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.motion import Motion

STEP = 1e-6


def moved(motion: Motion, column: int) -> Motion:
    """Return the motion with one of translation, rotation and angles changed by ``STEP``."""
    root, angles = motion.root.copy(), motion.angles.copy()
    if column < 3:
        root[:, column] += STEP
    elif column < 6:
        turn = Rotation.from_rotvec(STEP * np.eye(3)[column - 3])
        root[:, 3:] = (turn * Rotation.from_quat(root[:, 3:], scalar_first=True)).as_quat(scalar_first=True)
    else:
        angles[:, column - 6] += STEP
    return Motion(motion.time, root, angles)


@pytest.mark.parametrize("child", [False, True])
def test_derivatives_are_limits_of_differences(child):
    mover, rng = performer(4, child=child), np.random.default_rng(2)
    turns = Rotation.random(2, random_state=1).as_quat(scalar_first=True)
    root = np.concatenate([rng.normal(size=(2, 3)), turns], axis=1)
    motion = Motion(np.arange(2.0), root, rng.normal(0, 0.3, (2, len(DOFS))))
    pose = mover.linearised(motion)
    np.testing.assert_allclose(pose.joints, mover.joints(motion), atol=1e-12)
    for column in range(6 + len(DOFS)):
        other = mover.linearised(moved(motion, column))
        slope = (other.joints - pose.joints) / STEP
        np.testing.assert_allclose(pose.joint_derivatives[..., column], slope, atol=1e-4)
        turn = (other.feet @ pose.feet.swapaxes(-1, -2)).reshape(-1, 3, 3)
        spin = Rotation.from_matrix(turn).as_rotvec().reshape(2, 2, 3) / STEP
        np.testing.assert_allclose(pose.foot_derivatives[..., column], spin, atol=1e-4)
