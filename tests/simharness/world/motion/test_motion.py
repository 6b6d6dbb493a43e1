import numpy as np
import pytest

from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.motion import Motion


def upright(frames: int) -> np.ndarray:
    return np.tile([0.0, 0, 1, 1, 0, 0, 0], (frames, 1))


def test_motion_is_read_only_and_has_a_length():
    motion = Motion(time=np.arange(3.0), root=upright(3), angles=np.zeros((3, len(DOFS))))
    assert len(motion) == 3
    with pytest.raises(ValueError, match="read-only"):
        motion.angles[0, 0] = 1.0


@pytest.mark.parametrize(
    ("root", "angles", "message"),
    [
        (upright(3)[:, :6], np.zeros((3, 35)), r"motion root must be \(3, 7\), got \(3, 6\)"),
        (upright(3), np.zeros((2, 35)), r"motion angles must be \(3, 35\), got \(2, 35\)"),
        (2 * upright(3), np.zeros((3, 35)), "unit length"),
        (upright(2), np.array([[0.0] * 35, [np.nan] * 35]), "index 1"),
    ],
)
def test_bad_motions_are_refused(root, angles, message):
    with pytest.raises(ValueError, match=message):
        Motion(time=np.arange(float(len(root))), root=root, angles=angles)
