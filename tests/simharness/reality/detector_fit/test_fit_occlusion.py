import numpy as np

from simharness.detector.conditions import OUTSIDE
from simharness.reality.detector_fit import occlusion, sizes
from simharness.reality.detector_fit.shelf_twin import count_occlusion
from simharness.scenario.sections.detector import Detector


def test_boxes_match_those_of_silhouettes(twin):
    drawn, made = twin.views.boxes, sizes.boxes(twin.sequence.joints, twin.rig)
    whole = (twin.views.visibility != 4).all(axis=-1)
    assert whole.sum() > 3000
    ratio = np.sqrt(made[whole, 2:].prod(axis=-1) / drawn[whole, 2:].prod(axis=-1))
    assert abs(np.median(ratio) - 1) < 0.03
    assert np.quantile(abs(ratio - 1), 0.9) < 0.12


def test_people_behind_the_camera_or_unknown_have_no_box(twin):
    joints = twin.sequence.joints[:2].copy()
    joints[0, 0] = np.nan
    made = sizes.boxes(joints, twin.rig)
    assert (made[0, :, 0] == 0).all()
    assert (made[1, :, 0, 2] > 0).any()


def test_occlusion_from_skeletons_has_the_accuracy_of_CONFUSION(twin):
    sample = twin.detected(Detector.model_validate({"keypoints": {"scatter": 0.3, "drop": {"self_occluded": 0.3}}}))
    counted = count_occlusion(twin, sample)
    shares = counted / counted.sum(axis=-1, keepdims=True)
    assert counted.sum(axis=(0, 2)).min() > 1000
    # The scene is none of those behind CONFUSION: shares differ by a few per cent, and 90 % are correct.
    labels = counted.sum(axis=-1, keepdims=True) + 0 * counted
    assert np.average(abs(shares - occlusion.CONFUSION), weights=labels) < 0.035
    assert np.trace(counted.sum(axis=0)) / counted.sum() > 0.9
    np.testing.assert_allclose(occlusion.CONFUSION.sum(axis=-1), 1.0)


def test_triangulated_joints_of_the_face_turn_the_usual_face(twin):
    joints = twin.sequence.joints[:50]
    whole, normals = occlusion.complete_face(joints, joints)
    np.testing.assert_allclose(whole, joints)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, atol=0.01)
    partly = joints.copy()
    partly[..., 1:5, :] = np.nan
    guessed, _ = occlusion.complete_face(joints, partly)
    trunk, _ = occlusion.complete_face(joints, np.full(joints.shape, np.nan))
    error, worse = (np.linalg.norm(each - joints, axis=-1)[..., 1:5].mean() for each in (guessed, trunk))
    assert error < 0.07  # metres: a head is three times as large
    assert worse < 0.1


def test_joints_off_the_picture_are_outside(twin):
    joints = twin.sequence.joints[:5] + [50.0, 0, 0]
    labels = occlusion.occlusion_classes(*occlusion.complete_face(joints, joints), np.zeros((5, 0, 17, 3)), twin.rig)
    inside = np.stack([camera.inside(camera.project(joints)) for camera in twin.rig], axis=1)
    assert not inside.all()
    assert ((labels == OUTSIDE) == ~inside).all()
