"""Properties of answers: each fails where it should, and holds for the truth and for the method itself."""

from dataclasses import replace

import numpy as np
import pytest
from crowded_frames import crowd

from mvpose import Camera, Estimate, preset
from mvpose.estimate import Matching
from simharness.hunt.frozen_frame import freeze
from simharness.hunt.properties import PROPERTIES, FrameAnswer, mirrored_camera, property_of, violations


def perfect_frame():
    recording = crowd()
    return freeze(recording.rig, recording.detections[4], recording.truth[4]).with_errors(()).detected()


class Fixed:
    """Method that returns what a function makes of rig and detections."""

    def __init__(self, function):
        self.function = function

    def estimate(self, rig, detections):
        return self.function(rig, detections)


def of_joints(joints, **fields):
    joints = np.asarray(joints, float)
    return Estimate(joints, np.ones(joints.shape[:2]), Matching(np.zeros(0, int)), **fields)


def answer(joints, variant=None, rival=None, **fields):
    rig, detections, truth = perfect_frame()
    return FrameAnswer(rig, detections, truth, of_joints(joints, **fields), variant or preset("full"), rival)


def names(found):
    return {(each.property, each.person) for each in found}


def test_the_truth_violates_no_class_of_failures():
    truth = perfect_frame()[2].joints
    assert not violations(
        answer(truth), [name for name in PROPERTIES if name not in ("renamed", "rotated", "mirrored")]
    )


def test_classes_of_failures():
    truth = perfect_frame()[2].joints
    ghost = np.concatenate([truth, truth[:1] + [2.0, 0, 0]])
    assert names(violations(answer(ghost), ["ghost"])) == {("ghost", -1)}
    swapped = truth.copy()
    swapped[2, [9, 10]] = swapped[2, [10, 9]]
    (limb,) = violations(answer(swapped), ["swapped_limb"])
    assert limb.person == 2
    assert set(limb.joints) <= {9, 10}


def test_somebody_is_missed_in_plain_view_alone():
    rig, detections, truth = perfect_frame()
    found = of_joints(truth.joints[1:])
    given = FrameAnswer(rig, detections, truth, found, preset("full"))
    assert names(violations(given, ["missed"])) == {("missed", 0)}
    hidden = truth.visibility.copy()
    hidden[2:, 0] = 3
    assert not violations(replace(given, truth=replace(truth, visibility=hidden)), ["missed"])


@pytest.mark.parametrize(("spread", "fails"), [(0.01, True), (0.2, False)])
def test_errors_beyond_the_covariance(spread, fails):
    joints = perfect_frame()[2].joints.copy()
    joints[1, 9, 2] += 0.3
    covariance = np.broadcast_to(spread**2 * np.eye(3), (*joints.shape, 3))
    found = violations(answer(joints, covariance=covariance), ["overconfident"])
    assert names(found) == ({("overconfident", 1)} if fails else set())
    if fails:
        assert found[0].joints == (9,)
        assert "300 mm" in found[0].text


def test_the_method_regards_neither_order_nor_axes_nor_handedness():
    rig, detections, truth = perfect_frame()
    full = preset("full")
    given = FrameAnswer(rig, detections, truth, full.estimate(rig, detections), full)
    assert not violations(given, ["renamed", "rotated", "mirrored"])


def test_a_method_that_regards_them_is_found():
    truth = perfect_frame()[2].joints
    first = Fixed(lambda rig, detections: of_joints(truth[:1] + rig[0].center))
    rig, detections, _ = perfect_frame()
    given = replace(answer(truth, first), estimate=first.estimate(rig, detections))
    assert names(violations(given, ["renamed"])) == {("renamed", -1)}
    still = Fixed(lambda rig, detections: of_joints(truth))
    assert len(violations(answer(truth, still), ["rotated", "mirrored"])) == 2
    assert not violations(answer(truth, still), ["renamed"])


def test_a_rival_that_disagrees():
    truth = perfect_frame()[2].joints
    near, far = (Fixed(lambda rig, detections, by=by: of_joints(truth + by)) for by in (0.05, 0.2))
    assert not violations(answer(truth, rival=near), ["disagree"])
    assert violations(answer(truth, rival=far), ["disagree"])


def test_a_mirrored_camera_sees_the_mirrored_world_mirrored():
    rng = np.random.default_rng(0)
    K = np.array([[700.0, 3.0, 300.0], [0.0, 710.0, 250.0], [0.0, 0.0, 1.0]])
    camera = Camera(
        K, np.linalg.qr(rng.normal(size=(3, 3)))[0], [0.1, 0.2, 4.0], [0.1, -0.05, 0.01, -0.02, 0.01], (640, 480)
    )
    points = camera.R.T @ rng.uniform(-0.5, 0.5, (3, 50))
    pixels = camera.project(points.T)
    mirrored = mirrored_camera(camera).project(points.T * [1, -1, 1])
    np.testing.assert_allclose(mirrored, np.column_stack([639 - pixels[:, 0], pixels[:, 1]]), atol=1e-9)


def test_a_predicate_of_the_user(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("def few(rig, detections, truth, estimate):\n    return len(estimate) < 2 and 'too few'\n")
    truth = perfect_frame()[2].joints
    (found,) = violations(answer(truth[:1]), [f"{file}:few"])
    assert found.text == "too few"
    assert not violations(answer(truth), [f"{file}:few"])
    for name, what in (("luck", "no such property"), (f"{file}:many", "cannot be loaded")):
        with pytest.raises(ValueError, match=what):
            property_of(name)
