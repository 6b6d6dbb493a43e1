"""The 3D view of people: what it shows, against the trial; bodies as capsules around joints."""

import dataclasses

import numpy as np
import pytest

from mvpose import Estimate, Matching
from mvpose.report.view_3d import PYRAMID
from mvpose.skeleton import COCO17
from simharness.outputs.study import skeleton_view_3d as module
from simharness.outputs.study.skeleton_view_3d import BODY, SKELETON, body_points, scene_of, skeleton_view_3d


def pieces(scene, shape, frame=None):
    return [each for each in (scene.fixed if frame is None else scene.frames[frame]) if each.shape == shape]


@pytest.fixture
def drawn(shown):
    _, again = shown[0]
    return again, scene_of(again, 1)


def test_people_are_the_truth_as_lines_and_the_estimates_as_bodies(drawn):
    again, scene = drawn
    assert (scene.first, scene.start, len(scene.times)) == (0, 1, len(again.time))
    for frame in range(len(again.time)):
        truth = pieces(scene, SKELETON, frame)
        np.testing.assert_array_equal([each.points for each in truth], again.truth[frame].joints)
        estimated = [each.points[:17] for each in pieces(scene, BODY, frame) if each.style != module._NOBODY]
        np.testing.assert_array_equal(estimated, again.estimates[frame].joints)
        missed = sorted(set(range(len(truth))) - set(again.owners(frame).tolist()))
        assert [k for k, each in enumerate(truth) if each.style.dashed] == missed


def test_an_unknown_joint_is_null_and_a_ghost_is_grey(shown):
    _, again = shown[0]
    joints = np.stack([again.truth[1].joints[0], again.truth[1].joints[0] + [30.0, 0, 0]])
    joints[0, 3] = np.nan
    estimate = Estimate(joints, np.ones((2, 17)), Matching(np.full(len(again.detections[1]), -1)))
    estimates = (again.estimates[0], estimate, *again.estimates[2:])
    data = skeleton_view_3d(dataclasses.replace(again, estimates=estimates), 1).data
    first, ghost = data["frames"][1][:2]
    assert [k for k, point in enumerate(first[2]) if point is None] == [3]
    styles = [data["styles"][piece[1]]["color"] for piece in (first, ghost)]
    assert styles == [module.css(module.person_color(0)), module.css(module.person_color(-1))]


def test_cameras_look_through_the_corners_of_their_pictures(drawn):
    again, scene = drawn
    shown = pieces(scene, PYRAMID)
    for camera, piece in zip(again.trial.exposures.believed_rig, shown, strict=True):
        np.testing.assert_allclose(piece.points[0], camera.center)
        width, height = camera.size
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
        np.testing.assert_allclose(camera.project(piece.points[1:]), corners, atol=0.02 * width)


def test_objects_have_twelve_edges_along_their_sides(drawn):
    _, scene = drawn
    objects = pieces(scene, module._HULL)
    assert objects
    for each in objects:
        sides = sorted(np.linalg.norm(each.points[[1, 2, 4]] - each.points[0], axis=1).tolist() * 4)
        edges = sorted(float(np.linalg.norm(each.points[a] - each.points[b])) for a, b in each.shape.lines)
        np.testing.assert_allclose(edges, sides)


def test_without_scripts_a_person_who_was_not_found_is_dashed(shown):
    _, again = shown[0]
    people = len(again.truth[1].joints)
    nothing = Estimate(np.zeros((0, 17, 3)), np.zeros((0, 17)), Matching(np.full(len(again.detections[1]), -1)))
    estimates = (again.estimates[0], nothing, *again.estimates[2:])
    still = skeleton_view_3d(dataclasses.replace(again, estimates=estimates), 1).still
    assert still.count("stroke-dasharray") == people


@pytest.mark.parametrize(("frame", "count"), [(0, 5), (4, 5), (0, 200), (100, 200), (199, 200)])
def test_the_frames_of_a_view_include_the_first_one_shown(frame, count):
    frames = module._frames_around(frame, count)
    assert frame in frames
    assert len(frames) == min(count, module.MAX_FRAMES)
    assert frames.start >= 0
    assert frames.stop <= count


def standing():
    """Return the joints of a person who stands at the origin, (17, 3), metres."""
    heights = {"hip": 0.95, "knee": 0.5, "ankle": 0.08, "shoulder": 1.45, "elbow": 1.15, "wrist": 0.9}
    joints = np.zeros((17, 3))
    for index, name in enumerate(COCO17.joints):
        side = {"left": 0.18, "right": -0.18}.get(name.split("_")[0], 0.0)
        joints[index] = (0.0, side, heights.get(name.split("_")[-1], 1.65))
    return joints


def parts(joints):
    """Return the points and the radius of each part of a body whose points are known."""
    points = body_points(joints)
    return [(points[list(part)], radius) for part, radius in BODY.bodies if np.isfinite(points[list(part)]).all()]


def test_a_whole_person_has_limbs_trunk_neck_and_head():
    assert sorted(len(points) for points, _ in parts(standing())) == [1, *[2] * 9, 4]
    ((head, radius),) = [(points, radius) for points, radius in parts(standing()) if len(points) == 1]
    np.testing.assert_allclose(head[0], standing()[:5].mean(axis=0))
    assert 0.07 < radius < 0.13


def test_left_and_right_are_alike():
    limbs = [(part, radius) for part, radius in BODY.bodies if len(part) == 2 and max(part) < 17]
    radii = {(COCO17.mirror[a], COCO17.mirror[b]): radius for (a, b), radius in limbs}
    assert radii == dict(limbs)


@pytest.mark.parametrize(("missing", "lost"), [("left_elbow", 2), ("left_ankle", 1), ("left_hip", 2), ("nose", 0)])
def test_parts_of_unknown_joints_are_left_out(missing, lost):
    joints = standing()
    joints[COCO17.index(missing)] = np.nan
    assert len(parts(joints)) == 11 - lost


def test_a_person_without_joints_has_no_parts():
    assert parts(np.full((17, 3), np.nan)) == []
