"""Repair of rigs that are far off, and refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
from moving_people import disturbed, film, walk
from people import ring
from scipy.spatial.transform import Rotation

from mvpose import COCO17, Detections, Rig
from mvpose.calibration import repair
from mvpose.calibration.calibration_prior import Prior
from mvpose.calibration.normal_equations import FOCAL, changed, difference
from mvpose.calibration.rig_size import published_limbs, resized

RIG = ring(5)
PERIOD = 0.1
JOINTS = walk(3, frames=60, seed=2)


@pytest.fixture(scope="module")
def frames():
    return film(RIG, JOINTS, noise=4.0)[0]


def shape_error(rig):
    """Greatest error of relative poses to camera 0: degrees, and metres with the size of the rig taken out."""

    def relative(of):
        turns = np.stack([of[0].R @ camera.R.T for camera in of])
        arms = (of.centers - of.centers[0]) @ of[0].R.T
        return turns, arms / np.linalg.norm(arms[2])

    (turns, arms), (true_turns, true_arms) = relative(rig), relative(RIG)
    cosine = (np.einsum("vab,vab->v", turns, true_turns) - 1) / 2
    size = np.linalg.norm(RIG.centers[2] - RIG.centers[0])
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))).max(), size * np.linalg.norm(arms - true_arms, axis=1).max()


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "metres"), [(2, 0.2), (4, 0.4)])
def test_cameras_that_are_all_off_agree_with_each_other_after_repair(frames, degrees, metres):
    wrong = disturbed(RIG, degrees, metres, seed=3)
    found = repair(wrong, frames, period=PERIOD)
    assert found.refused is None
    assert not found.held
    assert shape_error(wrong)[0] > degrees
    degrees, metres = shape_error(found.rig)
    assert degrees < 0.4
    assert metres < 0.05
    np.testing.assert_allclose(found.residuals_after, repair(RIG, frames, period=PERIOD).residuals_after, rtol=0.03)


def test_the_whole_rig_stays_where_most_cameras_are(frames):
    wrong = disturbed(RIG, 3, 0.3, seed=8, views=[1])
    found = repair(wrong, frames, period=PERIOD)
    error = np.stack([difference(a, b)[:6] for a, b in zip(RIG, found.rig, strict=True)])
    assert np.degrees(np.linalg.norm(error[:, :3], axis=1)).max() < 0.25
    assert np.linalg.norm(error[:, 3:], axis=1).max() < 0.025
    turns = [Rotation.from_matrix(b.R.T @ a.R).as_rotvec() for a, b in zip(wrong, found.rig, strict=True)]
    np.testing.assert_allclose(found.corrections[:, :3], turns, atol=1e-9)
    np.testing.assert_allclose(found.corrections[:, 3:], found.rig.centers - wrong.centers, atol=1e-9)


def test_the_file_of_a_repair_has_the_covariance_in_degrees_and_metres(frames):
    found = repair(disturbed(RIG, 1, 0.1, seed=8, views=[1]), frames, period=PERIOD)
    for view, camera in enumerate(found.to_json()["cameras"]):
        variance = np.diag(found.covariance[view])
        assert np.deg2rad(camera["sigma_degrees"]) ** 2 == pytest.approx(variance[:3])
        assert np.square(camera["sigma_metres"]) == pytest.approx(variance[3:])
        assert np.deg2rad(camera["rotation_degrees"]) == pytest.approx(found.corrections[view, :3])
        assert camera["shift_metres"] == pytest.approx(found.corrections[view, 3:])


def test_a_right_rig_hardly_changes(frames):
    found = repair(RIG, frames, period=PERIOD)
    assert np.degrees(np.abs(found.corrections[:, :3])).max() < 0.1
    assert np.abs(found.corrections[:, 3:]).max() < 0.01
    assert np.abs(found.offsets).max() < 0.01


@pytest.mark.slow
def test_a_clock_that_is_late_is_found():
    """Camera 2 took its pictures 0.08 s after the time that they carry."""
    period, late = 0.04, 0.08
    joints = walk(3, frames=150, period=period, seed=2)
    shifted = walk(3, frames=150, period=period, seed=2)[2:]  # two periods later
    on_time, delayed = film(RIG, joints[:148], noise=3.0)[0], film(RIG, shifted, noise=3.0)[0]

    def mixed(one, other):
        keep, take = one.view != 2, other.view == 2
        return Detections.from_keypoints(
            np.append(one.view[keep], other.view[take]),
            np.concatenate([one.keypoints[keep], other.keypoints[take]]),
            np.concatenate([one.scores[keep], other.scores[take]]),
        )

    found = repair(RIG, [mixed(a, b) for a, b in zip(on_time, delayed, strict=True)], period=period)
    np.testing.assert_allclose(found.offsets - np.median(found.offsets), [0, 0, late, 0, 0], atol=0.012)


def test_a_focal_length_is_found_where_it_may_change(frames):
    change = np.zeros(11)
    change[FOCAL] = 0.03
    wrong = Rig([changed(camera, change) if view == 4 else camera for view, camera in enumerate(RIG)])
    found = repair(wrong, frames, period=PERIOD, free=("extrinsics", "focal"), cameras=["cam4"])
    np.testing.assert_allclose(found.focal, [1, 1, 1, 1, np.exp(-0.03)], atol=0.01)
    assert not found.corrections[:4].any()


def refusals():
    one = walk(1, frames=60, still=True)
    yield "two cameras", Rig(list(RIG)[:2]), film(Rig(list(RIG)[:2]), JOINTS)[0], "two cameras"
    yield "still", RIG, film(RIG, one, noise=4.0)[0], "too few places"
    alone = [{0}, {1}, {2}, {3}, {4}]
    yield "other people", RIG, film(RIG, walk(5, frames=60, seed=5), noise=4.0, only=alone)[0], "cannot tell"
    yield "nobody", RIG, [Detections.empty()] * 5, "no detections"
    yield "no frames", RIG, [], "no detections"


@pytest.mark.parametrize(("rig", "frames", "text"), [each[1:] for each in refusals()], ids=[e[0] for e in refusals()])
def test_what_the_data_do_not_determine_is_not_changed(rig, frames, text):
    wrong = disturbed(rig, 1, 0.1)
    found = repair(wrong, frames, period=PERIOD)
    assert found.rig is wrong
    assert text in found.refused
    assert not found.corrections.any()
    assert len(found.held) == len(rig)
    json.dumps(found.to_json(), allow_nan=False)


def test_a_camera_that_sees_somebody_else_is_held():
    only = [{0, 1}, {0, 1}, {0, 1}, {0, 1}, {2}]
    found = repair(disturbed(RIG, 1, 0.1), film(RIG, JOINTS, noise=4.0, only=only)[0], period=PERIOD)
    assert found.refused is None
    assert len(found.held) == 1
    assert found.held[0].startswith("camera cam4: cannot tell")
    assert not found.corrections[4].any()
    assert found.corrections[:4].any(axis=1).all()


@pytest.mark.slow
def test_the_order_of_cameras_does_not_matter(frames):
    wrong = disturbed(RIG, 2, 0.2, seed=3)
    order = [3, 0, 4, 1, 2]
    place = np.argsort(order)
    moved = [replace(each, view=place[each.view]) for each in frames]
    one = repair(wrong, frames, period=PERIOD)
    other = repair(Rig([wrong[view] for view in order]), moved, period=PERIOD)
    np.testing.assert_allclose(other.corrections, one.corrections[order], atol=2e-3)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [({"free": ("lens",)}, "free"), ({"cameras": ["cam9"]}, "cam9"), ({"cameras": [7]}, "0 to 4")],
)
def test_bad_arguments_are_refused(frames, arguments, text):
    with pytest.raises(ValueError, match=text):
        repair(RIG, frames, period=PERIOD, **arguments)


@pytest.mark.slow
def test_the_size_of_people_decides_that_of_the_rig_where_asked(frames):
    """A rig 30 % too large: the lengths of limbs give its size, and nothing else changes."""
    large = resized(RIG, 1.3)
    by_rig = repair(large, frames, period=PERIOD)
    by_people = repair(large, frames, period=PERIOD, size="people")
    size = np.mean([published_size(each) for each in JOINTS[0]])  # of the people, relative to the published adult
    arms = [np.linalg.norm(each.rig.centers - each.rig.centers.mean(axis=0)) for each in (by_rig, by_people)]
    true = np.linalg.norm(RIG.centers - RIG.centers.mean(axis=0)) / size
    assert by_rig.scale == 1.0
    assert arms[0] == pytest.approx(1.3 * size * true, rel=0.01)
    assert arms[1] == pytest.approx(true, rel=0.02)
    assert (by_people.covariance.trace(axis1=1, axis2=2) > by_rig.covariance.trace(axis1=1, axis2=2)).all()
    both = repair(large, frames, period=PERIOD, size="both").scale
    assert by_people.scale < both < 1.0
    sure = repair(large, frames, period=PERIOD, size="both", prior=Prior(1e-5, 1e-5)).scale
    assert sure == pytest.approx(1.0, abs=0.01)
    with pytest.raises(ValueError, match="size must be one of calibration, people, both, got 'mine'"):
        repair(RIG, frames, period=PERIOD, size="mine")


def published_size(joints):
    parents, children, length = published_limbs(COCO17)
    return np.median(np.linalg.norm(joints[parents] - joints[children], axis=-1) / length)
