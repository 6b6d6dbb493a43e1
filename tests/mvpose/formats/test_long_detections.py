"""Detections that are read in parts and kept on disk are those that were written, whatever the size of a part."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lab_files import filmed, write_coco, write_mmpose, write_rtmlib

from mvpose.files.input_files import json_list_parts
from mvpose.formats.detections import detection_file, recorded_frames
from mvpose.formats.detections.detection_file import PicturePeople
from mvpose.formats.detections.picture_store import PictureStore
from mvpose.formats.detections.recorded_frames import read_recording
from mvpose.formats.joint_names import KNOWN

NAMES = ["cam0", "cam1", "cam2", "cam3"]
ENTRIES = st.recursive(
    st.none() | st.integers(-9, 10**6) | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=9,
)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(entries=st.lists(ENTRIES, max_size=12), indent=st.sampled_from([None, 1]), size=st.integers(1, 90))
def test_a_list_in_parts_has_the_entries_of_the_whole(tmp_path_factory, entries, indent, size):
    file = tmp_path_factory.getbasetemp() / "list.json"
    file.write_text(json.dumps(entries, indent=indent, ensure_ascii=False), "utf-8-sig")
    size = max([size, *(len(json.dumps(each, indent=indent)) + 9 for each in entries)])  # of one entry at least
    parts = list(json_list_parts(file, what="a list", size=size))
    assert [each for part in parts for each in part] == entries


@pytest.mark.parametrize("text", ['[{"a": 1}, {"a"', "[1, 2", '[{"a": 1}, nan]', "[1] 2", '["' + 200 * "x", "[1 2]"])
def test_a_list_that_is_cut_off_is_refused(tmp_path, text):
    file = tmp_path / "list.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"list.json: broken or truncated JSON .* copy or download it again"):
        list(json_list_parts(file, what="a list", size=32))


def test_what_is_no_list_has_no_parts(tmp_path):
    file = tmp_path / "object.json"
    file.write_text('{"a": [1, 2]}')
    assert list(json_list_parts(file, what="a list", size=32)) == []


def people(count, joints, rng):
    return PicturePeople(
        rng.random((count, len(joints), 2)), rng.random((count, len(joints))), rng.random((count, 4)),
        rng.random(count), joints,
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(
    numbers=st.lists(st.integers(0, 30), unique=True, max_size=12),
    counts=st.lists(st.integers(0, 3), min_size=12, max_size=12),
)
def test_pictures_come_back_as_they_were(numbers, counts):
    rng = np.random.default_rng(0)
    given = {n: people(k, KNOWN["coco17" if n % 2 else "body25"], rng) for n, k in zip(numbers, counts, strict=False)}
    store = PictureStore(given.items())
    assert list(store) == sorted(given)
    for number, each in given.items():
        assert number in store
        assert len(store[number]) == len(each)
        if len(each):
            assert store[number].joints == each.joints
            for key in ("keypoints", "scores", "boxes", "box_scores"):
                np.testing.assert_array_equal(getattr(store[number], key), getattr(each, key))
    assert store.get(31) is None
    assert {each.joints.name for each in store.examples()} == {each.joints.name for each in given.values() if len(each)}
    again = {n: people(len(each), each.joints, rng) for n, each in given.items()}
    assert (PictureStore(again.items()).digest == store.digest) == (not sum(map(len, given.values())))


@pytest.mark.parametrize("write", [write_coco, write_mmpose, write_rtmlib])
@pytest.mark.parametrize("part", [1500, 4000])
def test_a_long_file_is_read_like_a_short_one(tmp_path, monkeypatch, write, part):
    _, _, pixels = filmed(frames=11)
    write(tmp_path / "lab", NAMES, pixels)
    whole = read_recording(NAMES, [tmp_path / "lab"])
    monkeypatch.setattr(detection_file, "LONG_LIST", part)
    monkeypatch.setattr(recorded_frames, "IN_MEMORY", 3)
    assert len(list(detection_file.DetectionFile(tmp_path / "lab" / "cam0.json").parts())) > 2
    parts = read_recording(NAMES, [tmp_path / "lab"])
    times = np.repeat(parts.numbers[:, None] / 25.0, 4, axis=1)
    frames = parts.detections(times)
    assert not isinstance(frames, list)
    assert len(frames) == len(frames[2:]) + 2 == 11
    for one, other in zip(whole.detections(times), frames, strict=True):
        for key in ("view", "keypoints", "scores", "boxes", "box_scores", "time"):
            np.testing.assert_array_equal(getattr(one, key), getattr(other, key))


def test_two_entries_of_one_frame_in_different_parts_are_refused(tmp_path, monkeypatch):
    _, _, pixels = filmed(frames=11)
    write_mmpose(tmp_path / "lab", NAMES, pixels)
    entries = json.loads((tmp_path / "lab" / "cam1.json").read_text())
    entries[-1]["frame_id"] = 0
    (tmp_path / "lab" / "cam1.json").write_text(json.dumps(entries))
    monkeypatch.setattr(detection_file, "LONG_LIST", 4000)
    with pytest.raises(ValueError, match=r"cam1.json: has two entries of one frame"):
        read_recording(NAMES, [tmp_path / "lab"])
