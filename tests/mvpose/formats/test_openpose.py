import json

import numpy as np
import pytest

from mvpose import COCO17
from mvpose.formats.detections.openpose import read_frame, read_people

# OpenPose's own names of BODY_25, from its documentation of the output format.
# fmt: off
BODY_25 = (
    "nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow",
    "left_wrist", "mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle",
    "right_eye", "left_eye", "right_ear", "left_ear",
    "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe", "right_heel",
)
# fmt: on


def person(offset=0.0):
    """25 keypoints whose coordinates tell which they are."""
    return np.array([[100.0 + index + offset, 200.0 + 2 * index + offset, 0.5 + index / 100] for index in range(25)])


def written(path, *people):
    path.write_text(
        json.dumps({"version": 1.3, "people": [{"pose_keypoints_2d": np.ravel(p).tolist()} for p in people]})
    )
    return path


def test_every_joint_keeps_its_name(tmp_path):
    keypoints, scores = read_people(written(tmp_path / "0.json", person()))
    for joint, name in enumerate(COCO17.joints):
        index = BODY_25.index(name)
        assert keypoints[0, joint].tolist() == person()[index, :2].tolist()
        assert scores[0, joint] == person()[index, 2]


def test_score_0_is_missing_and_overshoot_is_cut(tmp_path):
    body = person()
    body[BODY_25.index("left_wrist")] = 0.0
    body[BODY_25.index("nose"), 2] = 1.017
    keypoints, scores = read_people(written(tmp_path / "0.json", body))
    missing = COCO17.index("left_wrist")
    assert scores[0, missing] == 0
    assert np.isnan(keypoints[0, missing]).all()
    assert np.isfinite(np.delete(keypoints[0], missing, axis=0)).all()
    assert scores[0, COCO17.index("nose")] == 1.0


def test_a_person_of_feet_only_is_left_out(tmp_path):
    feet = person()
    feet[:19] = 0.0
    keypoints, _ = read_people(written(tmp_path / "0.json", feet, person()))
    assert len(keypoints) == 1


def test_a_frame_joins_the_views(tmp_path):
    paths = [
        written(tmp_path / "0.json", person(), person(5)),
        written(tmp_path / "1.json"),
        written(tmp_path / "2.json", person(9)),
    ]
    detections = read_frame(paths)
    assert detections.view.tolist() == [0, 0, 2]
    assert detections.keypoints[:, 0, 0].tolist() == [100, 105, 109]
    used = person()[[BODY_25.index(name) for name in COCO17.joints], :2]
    low, high = used.min(axis=0), used.max(axis=0)
    np.testing.assert_allclose(detections.boxes[0], [*low, *(high - low)])


def test_nobody_anywhere_is_an_empty_frame(tmp_path):
    assert len(read_frame([written(tmp_path / "0.json"), written(tmp_path / "1.json")])) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"people": [{"pose_keypoi', "truncated JSON .*cut off"),
        ("", "truncated JSON .*0 bytes"),
        ('{"persons": []}', "no list 'people'"),
        ('{"people": [{"face": []}]}', r"people\[0\] has no 'pose_keypoints_2d'"),
        (json.dumps({"people": [{"pose_keypoints_2d": [0.1] * 54}]}), r"people\[0\].*75 numbers \(BODY_25\), got 54"),
        (json.dumps({"people": [{"pose_keypoints_2d": ["a"] * 75}]}), r"people\[0\].*other than numbers"),
        ('{"people": [{"pose_keypoints_2d": [' + "NaN," * 74 + "1]}]}", r"people\[0\].*not finite"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, message):
    path = tmp_path / "2_000000000017_keypoints.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"2_000000000017_keypoints\.json: .*{message}|keypoints\.json: {message}"):
        read_people(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"gone\.json: no such file; expected OpenPose output"):
        read_people(tmp_path / "gone.json")
