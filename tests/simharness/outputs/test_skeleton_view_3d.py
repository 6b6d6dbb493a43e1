"""The 3D view of people: its data against the trial, and its still drawing."""

import dataclasses
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mvpose import Estimate, Matching
from simharness.outputs.study import skeleton_view_3d as module
from simharness.outputs.study.skeleton_view_3d import skeleton_view_3d


@pytest.fixture
def drawn(shown):
    _, again = shown[0]
    return again, skeleton_view_3d(again, 1)


def test_joints_are_the_truth_and_the_estimates_in_millimetres(drawn):
    again, drawing = drawn
    data = json.loads(drawing.json)
    assert (data["first"], data["start"], len(data["time"])) == (0, 1, len(again.time))
    for frame in range(len(again.time)):
        np.testing.assert_allclose(np.array(data["truth"][frame]), 1000 * again.truth[frame].joints, atol=0.5)
        estimated = [joints for _, *joints in data["estimates"][frame]]
        expected = again.estimates[frame].joints
        assert len(estimated) == len(expected)
        for written, joints in zip(estimated, expected, strict=True):
            for one, joint in zip(written, joints, strict=True):
                assert (one is None) == bool(np.isnan(joint).any())
                assert one is None or np.allclose(one, 1000 * joint, atol=0.5)
        assert [owner for owner, *_ in data["estimates"][frame]] == again.owners(frame).tolist()


def test_a_joint_without_a_place_is_null_and_a_ghost_has_no_owner(shown):
    _, again = shown[0]
    joints = np.stack([again.truth[1].joints[0], again.truth[1].joints[0] + [30.0, 0, 0]])
    joints[0, 3] = np.nan
    estimate = Estimate(joints, np.ones((2, 17)), Matching(np.full(len(again.detections[1]), -1)))
    estimates = (again.estimates[0], estimate, *again.estimates[2:])
    data = skeleton_view_3d(dataclasses.replace(again, estimates=estimates), 1).data
    (owner, *first), (ghost, *_) = data["estimates"][1]
    assert (owner, ghost) == (0, -1)
    assert [k for k, joint in enumerate(first) if joint is None] == [3]


def test_cameras_look_through_the_corners_of_their_pictures(drawn):
    again, drawing = drawn
    for camera, (apex, *base) in zip(again.trial.exposures.believed_rig, drawing.data["cameras"], strict=True):
        np.testing.assert_allclose(np.array(apex) / 1000, camera.center, atol=1e-3)
        width, height = camera.size
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
        np.testing.assert_allclose(camera.project(np.array(base) / 1000), corners, atol=0.02 * width)


def test_boxes_have_twelve_edges_along_their_sides(drawn):
    _, drawing = drawn
    assert drawing.data["boxes"]
    for box in drawing.data["boxes"]:
        corners = np.array(box, float)
        sides = sorted(np.linalg.norm(corners[[1, 2, 4]] - corners[0], axis=1).tolist() * 4)
        edges = sorted(float(np.linalg.norm(corners[a] - corners[b])) for a, b in drawing.data["corners"])
        np.testing.assert_allclose(edges, sides, atol=2)


def test_the_still_drawing_is_svg_in_the_colours_of_the_page_with_everybody_in_it(drawn):
    again, drawing = drawn
    still = ET.fromstring(drawing.still)
    paths = list(still.iter("path"))
    truth = [path for path in paths if path.get("stroke") == "currentColor"]
    assert len(truth) == len(again.truth[1].joints)
    people = np.array([[float(n) for n in re.findall(r"-?\d+\.?\d*", path.get("d"))] for path in truth]).reshape(-1, 2)
    assert (people > 0).all()
    assert (people < [640, 400]).all()
    assert {path.get("stroke") for path in paths} >= {"var(--line)", "var(--faint)", "currentColor"}


def test_without_scripts_a_person_who_was_not_found_is_dashed(shown):
    _, again = shown[0]
    people = len(again.truth[1].joints)
    nothing = Estimate(np.zeros((0, 17, 3)), np.zeros((0, 17)), Matching(np.full(len(again.detections[1]), -1)))
    estimates = (again.estimates[0], nothing, *again.estimates[2:])
    still = skeleton_view_3d(dataclasses.replace(again, estimates=estimates), 1).still
    assert still.count("stroke-dasharray") == people
    assert "stroke-opacity" not in still


@pytest.mark.parametrize(("frame", "count"), [(0, 5), (4, 5), (0, 200), (100, 200), (199, 200)])
def test_the_frames_of_a_view_include_the_first_one_shown(frame, count):
    frames = module._frames_around(frame, count)
    assert frame in frames
    assert len(frames) == min(count, module.MAX_FRAMES)
    assert frames.start >= 0
    assert frames.stop <= count


def test_the_data_cannot_end_its_script(drawn):
    assert "<" not in drawn[1].json
