import numpy as np
import pytest
from recordings import PERSON
from scipy.spatial.transform import Rotation

from mvpose import COCO17
from simharness.scoring.bones import bone_errors


def test_moving_and_turning_changes_no_bone():
    moved = Rotation.from_rotvec([0.3, -0.5, 1.0]).apply(PERSON) + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(bone_errors(PERSON, moved), np.zeros(16), atol=1e-12)


def test_a_larger_person_has_larger_bones_by_as_much():
    lengths = [np.linalg.norm(PERSON[child] - PERSON[parent]) for parent, child in COCO17.edges]
    np.testing.assert_allclose(bone_errors(PERSON, 1.1 * PERSON), 0.1 * np.array(lengths))
    np.testing.assert_allclose(bone_errors(PERSON, 0.9 * PERSON), -0.1 * np.array(lengths))


@pytest.mark.parametrize("missing", ["left_wrist", "left_shoulder"])
def test_a_missing_joint_takes_its_bones_along(missing):
    estimate = PERSON.copy()
    estimate[COCO17.index(missing)] = np.nan
    bones = [COCO17.index(missing) in edge for edge in COCO17.edges]
    np.testing.assert_array_equal(np.isnan(bone_errors(PERSON, estimate)), bones)
    assert any(bones)
