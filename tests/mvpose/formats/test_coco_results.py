import json

import numpy as np
import pytest

from mvpose import COCO17
from mvpose.formats.detections.recorded_frames import read_frames
from mvpose.formats.joint_names import KNOWN, JointNames


def entry(frame, person, *, box=None, score=0.8):
    """A person as detection programs write it: x, y, score of each joint."""
    made = {"image_id": frame, "category_id": 1, "keypoints": np.ravel(person).tolist()}
    if score is not None:
        made["score"] = score
    return made | ({} if box is None else {"bbox": list(box)})


def person(seed, joints=17):
    random = np.random.default_rng(seed)
    return np.concatenate([random.uniform(0, 300, (joints, 2)), random.uniform(0.1, 0.9, (joints, 1))], axis=1)


def read(folder, **options):
    return read_frames(("left", "right"), folder, np.array([5, 6, 9]), format="coco", **options)


def write(folder, **cameras):
    for camera, entries in cameras.items():
        (folder / f"{camera}.json").write_text(json.dumps(entries))
    return folder


def test_people_belong_to_the_frame_and_the_camera_that_they_name(tmp_path):
    a, b, c, other = (person(seed) for seed in range(4))
    write(
        tmp_path, right=[entry(9, c, box=(1, 2, 3, 4)), entry(5, b), entry(700, other)], left=[entry(5, a, score=1.3)]
    )
    first, second, third = read(tmp_path)
    assert first.view.tolist() == [0, 1]
    assert third.view.tolist() == [1]
    assert len(second) == 0
    for got, given in ((first.keypoints[0], a), (first.keypoints[1], b), (third.keypoints[0], c)):
        np.testing.assert_array_equal(got, given[:, :2])
    np.testing.assert_array_equal(third.scores[0], c[:, 2])
    assert third.boxes.tolist() == [[1, 2, 3, 4]]
    assert first.box_scores.tolist() == [1.0, 0.8]


def test_without_a_box_it_spans_the_joints_and_without_a_score_it_is_their_mean(tmp_path):
    a = person(0)
    write(tmp_path, left=[entry(5, a, score=None)], right=[entry(6, a)])
    (detections, *_) = read(tmp_path)
    low, high = a[:, :2].min(axis=0), a[:, :2].max(axis=0)
    np.testing.assert_allclose(detections.boxes[0], [*low, *(high - low)])
    assert detections.box_scores[0] == pytest.approx(a[:, 2].mean())


def test_other_skeletons_are_converted_by_name(tmp_path):
    order = np.random.default_rng(5).permutation(17)
    names = JointNames("mixed", tuple(COCO17.joints[k] for k in order))
    a = person(1)
    write(tmp_path, left=[entry(5, a[order])], right=[entry(5, a[order])])
    (detections, *_) = read(tmp_path, skeleton=names)
    np.testing.assert_array_equal(detections.keypoints[0], a[:, :2])


@pytest.mark.parametrize(
    ("left", "message"),
    [
        ([entry(5, person(0)), entry(5, person(0, 25))], r"left\.json: entry 1: keypoints must be 51 .* got 75"),
        ([{"keypoints": [0.0] * 51}], r"left\.json: entry 0: expected image_id, .* got null"),
        ([{"image_id": "a.jpg", "keypoints": []}], r'left\.json: entry 0: expected image_id, .* got "a\.jpg"'),
        ([{"image_id": 5}], r"left\.json: entry 0: no numbers 'keypoints'"),
        ({"annotations": []}, r"left\.json: expected COCO keypoint results: a list .*, got a dict"),
        ([entry(100, person(0))], r"left\.json: has frames 100 to 100, none of the requested frames 5 to 9"),
    ],
)
def test_faults_are_named(tmp_path, left, message):
    write(tmp_path, left=left, right=[entry(5, person(0))])
    with pytest.raises(ValueError, match=message):
        read(tmp_path)


def test_a_camera_without_file_is_named(tmp_path):
    write(tmp_path, left=[])
    with pytest.raises(ValueError, match=r"no detections for the camera right: the detections are called left"):
        read(tmp_path)
    (tmp_path / "right.json").write_text('[{"image_id": 5')
    with pytest.raises(ValueError, match=r"right\.json: broken or truncated JSON"):
        read(tmp_path)


def test_results_of_body25_have_75_numbers(tmp_path):
    write(tmp_path, left=[entry(5, person(0, 25))], right=[])
    (detections, *_) = read(tmp_path, skeleton=KNOWN["body25"])
    np.testing.assert_array_equal(detections.keypoints[0, 0], person(0, 25)[0, :2])
