"""The drawing that turns: its data against the trial, its poster against the geometry of a pinhole."""

import dataclasses
import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mvpose import Camera, Estimate, Matching
from simharness.report.figures import turnable as module
from simharness.report.figures.turnable import turnable


@pytest.fixture
def drawn(shown):
    _, again = shown[0]
    return again, turnable(again, 1)


def test_joints_are_the_truth_and_the_estimates_in_millimetres(drawn):
    again, drawing = drawn
    data = json.loads(drawing.json)
    assert (data["first"], data["start"], len(data["time"])) == (0, 1, len(again.time))
    for frame in range(len(again.time)):
        np.testing.assert_allclose(np.array(data["truth"][frame]), 1000 * again.truth[frame].joints, atol=0.5)
        estimated = [joints for _, *joints in data["estimates"][frame]]
        expected = again.estimates[frame].joints
        assert len(estimated) == len(expected)
        for said, joints in zip(estimated, expected, strict=True):
            for one, joint in zip(said, joints, strict=True):
                assert (one is None) == bool(np.isnan(joint).any())
                assert one is None or np.allclose(one, 1000 * joint, atol=0.5)
        assert [owner for owner, *_ in data["estimates"][frame]] == again.owners(frame).tolist()


def test_a_joint_without_a_place_is_null_and_a_ghost_has_no_owner(shown):
    _, again = shown[0]
    joints = np.stack([again.truth[1].joints[0], again.truth[1].joints[0] + [30.0, 0, 0]])
    joints[0, 3] = np.nan
    estimate = Estimate(joints, np.ones((2, 17)), Matching(np.full(len(again.detections[1]), -1)))
    estimates = (again.estimates[0], estimate, *again.estimates[2:])
    data = turnable(dataclasses.replace(again, estimates=estimates), 1).data
    (owner, *first), (ghost, *_) = data["estimates"][1]
    assert (owner, ghost) == (0, -1)
    assert [k for k, joint in enumerate(first) if joint is None] == [3]


def test_cameras_look_through_the_corners_of_their_pictures(drawn):
    again, drawing = drawn
    for camera, (apex, *base) in zip(again.trial.shots.believed, drawing.data["cameras"], strict=True):
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


def test_the_poster_is_what_a_pinhole_sees_from_above_the_people(drawn):
    _, drawing = drawn
    data, project = drawing.data, module._Projection(drawing.data)
    center, yaw, pitch = np.array(data["center"]) / 1000, data["yaw"], data["pitch"]
    toward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    eye = center + data["far"] * data["radius"] / 1000 * toward
    right = np.cross(-toward, [0, 0, 1])
    right /= np.linalg.norm(right)
    R = np.stack([right, np.cross(-toward, right), -toward])
    K = np.array([[project.scale, 0, 320], [0, project.scale, 0.45 * 400], [0, 0, 1]])
    camera = Camera(K, R, -R @ eye, size=(640, 400), name="eye")
    points = np.random.default_rng(0).uniform(-3, 3, (50, 3))
    np.testing.assert_allclose(
        [project((1000 * point).tolist()) for point in points], camera.project(points), atol=1e-6
    )
    assert eye[2] > 1.5


def test_the_poster_is_svg_in_the_colours_of_the_page_with_everybody_in_it(drawn):
    again, drawing = drawn
    poster = ET.fromstring(drawing.poster)
    paths = list(poster.iter("path"))
    truth = [path for path in paths if path.get("stroke") == "currentColor"]
    assert len(truth) == len(again.truth[1].joints)
    people = np.array([[float(n) for n in re.findall(r"-?\d+\.?\d*", path.get("d"))] for path in truth]).reshape(-1, 2)
    assert (people > 0).all()
    assert (people < [640, 400]).all()
    assert {path.get("stroke") for path in paths} >= {"var(--line)", "var(--faint)", "currentColor"}


@pytest.mark.parametrize(("frame", "count"), [(0, 5), (4, 5), (0, 200), (100, 200), (199, 200)])
def test_the_frames_of_a_drawing_hold_the_one_it_begins_with(frame, count):
    frames = module._around(frame, count)
    assert frame in frames
    assert len(frames) == min(count, module.MOST_FRAMES)
    assert frames.start >= 0
    assert frames.stop <= count


def test_the_data_cannot_end_its_script(drawn):
    assert "<" not in drawn[1].json
