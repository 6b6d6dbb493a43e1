import numpy as np

from simharness.detector.viewing_conditions import OUTSIDE, Conditions
from simharness.reality.detector_fit import occlusion


def test_boxes_match_those_of_silhouettes(filmed):
    drawn, made = filmed.views.boxes, occlusion.person_boxes(filmed.sequence.joints, filmed.rig)
    whole = (filmed.views.visibility != 4).all(axis=-1)
    assert whole.sum() > 2000
    ratio = np.sqrt(made[whole, 2:].prod(axis=-1) / drawn[whole, 2:].prod(axis=-1))
    assert abs(np.median(ratio) - 1) < 0.03
    assert np.quantile(abs(ratio - 1), 0.9) < 0.12


def test_people_behind_the_camera_or_unknown_have_no_box(filmed):
    joints = filmed.sequence.joints[:2].copy()
    joints[0, 0] = np.nan
    made = occlusion.person_boxes(joints, filmed.rig)
    assert (made[0, :, 0] == 0).all()
    assert (made[1, :, 0, 2] > 0).any()


def test_occlusion_from_skeletons_is_that_of_rendered_bodies(filmed):
    """Nine of ten joints have the true class, and each class is as frequent as it is."""
    joints, normals = occlusion.complete_face(filmed.sequence.joints, filmed.sequence.joints)
    found = occlusion.occlusion_classes(joints, normals, np.zeros((len(filmed), 0, 17, 3)), filmed.rig)
    true = Conditions.of_views(filmed.views).occlusion
    inside = (true != OUTSIDE) & (found != OUTSIDE)
    counted = np.array([[(inside & (true == a) & (found == b)).sum() for b in range(3)] for a in range(3)])
    assert counted.sum(axis=1).min() > 500
    assert np.trace(counted) / counted.sum() > 0.9
    shares, of_true = counted.sum(axis=0) / counted.sum(), counted.sum(axis=1) / counted.sum()
    np.testing.assert_allclose(shares, of_true, atol=0.04)
    assert (np.diag(counted) / counted.sum(axis=1) > 0.6).all()  # also the rare classes


def test_people_behind_others_are_hidden_by_people_outside_of_the_sample_too(filmed):
    """Who hides a joint makes no difference: a person of the sample, or one without annotation."""
    joints = filmed.sequence.joints[:20]
    all_three = occlusion.occlusion_classes(*occlusion.complete_face(joints, joints), joints[:, :0], filmed.rig)
    two = joints[:, :2]
    with_other = occlusion.occlusion_classes(*occlusion.complete_face(two, two), joints[:, 2:], filmed.rig)
    np.testing.assert_array_equal(with_other, all_three[:, :, :2])
    alone = occlusion.occlusion_classes(*occlusion.complete_face(two, two), joints[:, :0], filmed.rig)
    assert (alone != with_other).any()


def test_triangulated_joints_of_the_face_turn_the_usual_face(filmed):
    joints = filmed.sequence.joints[:50]
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


def test_joints_off_the_picture_are_outside(filmed):
    joints = filmed.sequence.joints[:5] + [50.0, 0, 0]
    labels = occlusion.occlusion_classes(*occlusion.complete_face(joints, joints), np.zeros((5, 0, 17, 3)), filmed.rig)
    inside = np.stack([camera.inside(camera.project(joints)) for camera in filmed.rig], axis=1)
    assert not inside.all()
    assert ((labels == OUTSIDE) == ~inside).all()
