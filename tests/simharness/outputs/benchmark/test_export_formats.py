"""Formats of exported files: closed forms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose import COCO17
from mvpose.formats.detections.openpose import people_file, read_people
from mvpose.formats.joint_names import KNOWN
from mvpose.formats.people.panoptic_poses import body_scene
from mvpose.skeleton import PANOPTIC19
from mvpose.wholebody import skeleton_by_name
from simharness.outputs.benchmark.layout import confidences
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence, hd_names
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.types.views import Visibility

HIDDEN = (Visibility.SELF_OCCLUDED, Visibility.OCCLUDED_BY_PERSON, Visibility.OCCLUDED_BY_CLUTTER, Visibility.OUTSIDE)
# Of BODY_25, from OpenPose's documentation.
NECK, RIGHT_SHOULDER, LEFT_SHOULDER, MID_HIP, LEFT_HIP = 1, 2, 5, 8, 12


def confidence_of(joint: str, *visible: tuple[int, str]) -> float:
    """Return the confidence of a joint of the first of two people, who shows some joints in some of four views."""
    visibility = np.array(HIDDEN)[:, None, None] * np.ones((4, 2, 17), int)
    for view, shown in visible:
        visibility[view, 0, COCO17.index(shown)] = Visibility.VISIBLE
    result = confidences(visibility)
    assert not result[1].any()  # no view shows the second person
    return float(result[0, PANOPTIC19.index(joint)])


def test_confidence_counts_the_pictures_that_show_a_joint():
    assert confidence_of("left_knee", (0, "left_knee"), (2, "left_knee")) == 1.0
    assert confidence_of("left_knee", *((view, "left_knee") for view in range(4))) == 1.0
    assert confidence_of("left_knee", (3, "left_knee"), (0, "right_knee")) == 0.5
    assert confidence_of("left_knee", (3, "right_knee")) == 0.2
    assert confidence_of("left_knee") == 0.0


def test_the_neck_is_visible_with_a_shoulder_and_mid_hip_with_a_hip():
    assert confidence_of("neck", (0, "left_shoulder"), (1, "right_shoulder")) == 1.0
    assert confidence_of("neck", (0, "left_shoulder"), (0, "right_shoulder")) == 0.5
    assert confidence_of("mid_hip", (0, "left_shoulder"), (1, "right_hip")) == 0.5


def test_loaders_keep_people_with_hidden_hips_and_drop_invisible_people():
    """VoxelPose and others: a joint is valid above 0.1, and a person if BodyCenter is."""
    assert confidence_of("mid_hip", (0, "nose")) > 0.1
    assert not confidence_of("mid_hip") > 0.1


@pytest.mark.parametrize(("rate", "kind"), [(29.97, "hd_29_97"), (10.0, "hd_10")])
def test_a_body_is_centimetres_y_down(rate, kind):
    joints = np.arange(57.0).reshape(1, 19, 3) / 10
    scene = body_scene(joints, np.full((1, 19), 0.5), ids=[7], time=1.5, rate=rate)
    assert (scene["univTime"], scene["fpsType"]) == (1500.0, kind)
    (body,) = scene["bodies"]
    assert body["id"] == 7
    assert body["joints19"][4:8] == pytest.approx([30.0, -50.0, 40.0, 0.5])  # of (0.3, 0.4, 0.5)


@st.composite
def people(draw):
    count = draw(st.integers(0, 3))
    scores = np.array(
        draw(st.lists(st.sampled_from([0.0, 0.25, 1.0]) | st.floats(1e-6, 1), min_size=17 * count, max_size=17 * count))
    ).reshape(count, 17)
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    keypoints = np.where(scores[..., None] > 0, rng.uniform(-50, 2000, (count, 17, 2)), np.nan)
    return keypoints, scores


@given(people())
def test_keypoints_are_read_back_exactly(tmp_path_factory, given_people):
    keypoints, scores = given_people
    path = tmp_path_factory.mktemp("people") / "0_keypoints.json"
    path.write_text(json.dumps(people_file(keypoints, scores), allow_nan=False))
    found = (scores > 0).any(axis=1)
    back, back_scores = read_people(path)
    np.testing.assert_array_equal(back, keypoints[found])
    np.testing.assert_array_equal(back_scores, scores[found])


def test_people_without_keypoints_are_left_out():
    keypoints, scores = np.full((3, 17, 2), np.nan), np.zeros((3, 17))
    keypoints[1, 4], scores[1, 4] = (7.0, 8.0), 0.5
    (person,) = people_file(keypoints, scores)["people"]
    assert np.count_nonzero(person["pose_keypoints_2d"]) == 3


def test_neck_and_mid_hip_are_midpoints_where_both_ends_are_detected():
    keypoints, scores = np.full((2, 17, 2), np.nan), np.zeros((2, 17))
    for person, joints in enumerate([("left_shoulder", "right_shoulder", "left_hip"), ("left_hip", "right_hip")]):
        for k, joint in enumerate(joints):
            keypoints[person, COCO17.index(joint)] = (10.0 * k, 40.0 - 4 * k)
            scores[person, COCO17.index(joint)] = 0.9 - 0.2 * k
    first, second = (
        np.reshape(each["pose_keypoints_2d"], (25, 3)) for each in people_file(keypoints, scores)["people"]
    )
    np.testing.assert_allclose(first[NECK], (5.0, 38.0, 0.7))
    assert not first[MID_HIP].any()
    assert not second[NECK].any()
    np.testing.assert_allclose(second[MID_HIP], (5.0, 38.0, 0.7))
    np.testing.assert_allclose(first[[LEFT_SHOULDER, RIGHT_SHOULDER, LEFT_HIP], 0], (0, 10, 20))
    assert (first[:, 2] > 0).sum() == 4
    assert (second[:, 2] > 0).sum() == 3


@pytest.mark.parametrize("name", ["body25", "halpe26"])
def test_feet_are_written_where_they_are_detected(name):
    skeleton = skeleton_by_name(name)
    keypoints = np.random.default_rng(1).uniform(0, 500, (1, len(skeleton), 2))
    (person,) = people_file(keypoints, np.ones((1, len(skeleton))), skeleton=skeleton)["people"]
    written = dict(zip(KNOWN["body25"].joints, np.reshape(person["pose_keypoints_2d"], (25, 3)), strict=True))
    for joint, keypoint in zip(skeleton.joints, keypoints[0], strict=True):
        if joint in KNOWN["body25"].joints:
            np.testing.assert_array_equal(written[joint], [*keypoint, 1.0])
    hips = [skeleton.index(f"{side}_hip") for side in ("left", "right")]
    middle = keypoints[0, skeleton.index("mid_hip")] if name == "body25" else keypoints[0, hips].mean(axis=0)
    np.testing.assert_allclose(written["mid_hip"][:2], middle)


@pytest.mark.slow
def test_an_export_holds_the_feet_that_its_detector_reports(tmp_path, scenario):
    plan = ExportPlan(tmp_path / "feet", pictures=False)
    folder = export_sequence(scenario(detector=DetectorSection(skeleton="halpe26")), plan)
    files = sorted((folder / "openpose").rglob("*.json"))
    people = [person for file in files for person in json.loads(file.read_text())["people"]]
    feet = np.array([person["pose_keypoints_2d"] for person in people]).reshape(-1, 25, 3)[:, 19:]
    assert (feet[..., 2] > 0).mean() > 0.5
    assert json.loads((folder / "manifest.json").read_text())["skeletons"]["made"].endswith("feet are as detected")


def test_files_have_the_keys_of_openpose(shared_data):
    real = json.loads(next((shared_data / "shelf" / "openpose" / "0").glob("*.json")).read_text())
    ours = people_file(np.ones((1, 17, 2)), np.ones((1, 17)))
    assert list(ours) == list(real)
    assert set(ours["people"][0]) == set(real["people"][0])


def test_names_of_hd_cameras_stay_and_others_are_numbered():
    assert hd_names(["00_23", "00_03"]) == ("00_23", "00_03")
    assert hd_names(["00_23", "cam1", "00_00"]) == ("00_00", "00_01", "00_02")
    assert hd_names(["01_01", "01_02"]) == ("00_00", "00_01")  # VGA cameras by name
