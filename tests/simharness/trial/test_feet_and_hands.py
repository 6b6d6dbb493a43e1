"""Trials of people with feet and hands: truth, detections, estimates, scores, files."""

from pathlib import Path

import numpy as np
import pytest

from mvpose.wholebody import skeleton_by_name
from simharness.outputs.run.result_folder import _record
from simharness.scenario.load import load
from simharness.scoring.feet_and_hands import WHOLE_BODY_SCORES, WholeBodyInput, whole_body_scores
from simharness.trial.archive import pack_detected, unpack_detected
from simharness.trial.run_folder import read_run, write_run
from simharness.trial.run_trial import Known, run_trial

QUICKSTART = Path(__file__).parents[3] / "scenarios" / "quickstart.toml"
CHEAP = ("rendering.renderer=rays", "duration=0.6", "rate=10", "people.count=2", "cameras.count=4")


def trial(*more, until="score"):
    return run_trial(load(QUICKSTART, overrides=[*CHEAP, *more]), variants=["fast"], until=until)


@pytest.fixture(scope="module")
def typical():
    return trial("detector.skeleton=wholebody133")


def test_without_errors_feet_and_hands_are_exact():
    """Truth, pixels, detections, triangulation and scores agree on where every joint is."""
    result = trial("detector.profile=perfect", "detector.skeleton=wholebody133")
    scores = result.assessments["fast"].scores
    assert scores["feet_mm"] < 0.1
    assert scores["hands_mm"] < 0.1
    assert scores["feet_pck"] > 90
    assert scores["hands_pck"] > 90


def test_toes_point_forward_and_feet_are_on_the_floor_where_people_stand():
    result = trial('people.activities=["stand"]', "detector.skeleton=halpe26", until="detect")
    skeleton = skeleton_by_name("halpe26")
    joints = np.stack([frame.whole.joints for frame in result.detected.frames])
    place = {name: joints[:, :, k] for k, name in enumerate(skeleton.joints)}
    forward = np.cross(place["left_hip"] - place["right_hip"], [0.0, 0.0, 1.0])
    for side in ("left", "right"):
        toes, heel = place[f"{side}_big_toe"], place[f"{side}_heel"]
        assert (((toes - heel) * forward).sum(axis=-1) > 0).all()
        for joint in ("big_toe", "small_toe"):
            assert (np.abs(place[f"{side}_{joint}"][..., 2] - 0.025) < 0.02).all()
        assert (np.abs(heel[..., 2] - 0.045) < 0.02).all()


def test_the_body_is_the_same_to_the_bit(typical):
    plain = trial()
    for one, other in zip(plain.detected.frames, typical.detected.frames, strict=True):
        assert one.whole is None
        for key in ("keypoints", "scores", "boxes", "box_scores"):
            np.testing.assert_array_equal(getattr(one.detections, key), getattr(other.detections, key))
        for key in ("joints", "pixels", "visibility", "error"):
            np.testing.assert_array_equal(getattr(one.truth, key), getattr(other.truth, key))
    for body, with_feet, whole in zip(
        plain.estimates["fast"], typical.estimates["fast"], typical.whole["fast"], strict=True
    ):
        np.testing.assert_array_equal(body.joints, with_feet.joints)
        np.testing.assert_array_equal(body.joints, whole.joints[:, :17])
    differing = {key for key, value in plain.assessments["fast"].scores.items()
                 if value != typical.assessments["fast"].scores[key] and not key.startswith("time_")}  # fmt: skip
    assert differing == set(WHOLE_BODY_SCORES)


def test_stored_detections_give_the_same_feet(typical):
    restored = unpack_detected(pack_detected(typical.detected), typical.scenario)
    again = run_trial(typical.scenario, variants=["fast"], until="score", known=Known(restored))
    for key in WHOLE_BODY_SCORES:
        assert again.assessments["fast"].scores[key] == typical.assessments["fast"].scores[key] is not None


def test_a_result_folder_holds_feet_and_hands(typical, tmp_path):
    record = _record(typical, {})
    write_run(record, tmp_path)
    read = read_run(tmp_path)
    scores = read.summary["variants"]["fast"]["scores"]
    assert all(scores[key] == typical.assessments["fast"].scores[key] for key in WHOLE_BODY_SCORES)
    found = np.concatenate([estimate.joints for estimate in typical.whole["fast"]])
    np.testing.assert_array_equal(read.whole_body["fast/joints"], found)
    true = np.stack([frame.whole.joints for frame in typical.detected.frames])
    np.testing.assert_array_equal(read.whole_body["joints"], true)
    assert str(read.whole_body["skeleton"]) == "wholebody133"


def test_scores_of_feet_are_those_of_the_paired_person():
    skeleton = skeleton_by_name("halpe26")
    truth = np.zeros((1, 2, 26, 3))
    truth[:, 1] += 1.0
    joints = truth[0, ::-1].copy()  # the second estimate is the first person
    joints[1, skeleton.index("left_heel")] += [0.0, 0.03, 0.04]  # 50 mm
    joints[1, skeleton.index("left_big_toe")] = np.nan
    scores = whole_body_scores(WholeBodyInput(skeleton, truth, [joints]), np.array([[1, 0]]))
    assert scores["feet_mm"] == pytest.approx(50 / 11)
    assert scores["feet_pck"] == pytest.approx(100 * 11 / 12)
    assert scores["hands_mm"] is scores["hands_pck"] is None
    missed = whole_body_scores(WholeBodyInput(skeleton, truth, [joints]), np.array([[-1, 0]]))
    assert missed["feet_pck"] == pytest.approx(50)


def test_a_network_that_reads_the_body_alone_is_refused(tmp_path):
    with pytest.raises(ValueError, match="leave skeleton or the network out"):
        load(QUICKSTART, overrides=[f"detector.onnx={tmp_path / 'head.onnx'}", "detector.skeleton=halpe26"])
