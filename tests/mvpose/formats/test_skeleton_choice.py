"""Skeletons of files that do not name their joints: chosen by the bones of people, or refused."""

import json

import numpy as np
import pytest
from lab_files import filmed

from mvpose import COCO17
from mvpose.formats.detections.detection_file import PicturePeople, nameless_skeleton
from mvpose.formats.detections.recorded_frames import read_recording
from mvpose.formats.detections.skeleton_choice import FITS, choose_skeletons, deviation
from mvpose.formats.joint_names import KNOWN, JointNames


def people(name, *, frames=12):
    """People who walk, in pictures on a skeleton whose joints have no names; those beyond COCO-17 at the nose."""
    names = KNOWN[name]
    rows = np.maximum(JointNames("coco17", COCO17.joints).rows(names.joints), 0)
    pixels = filmed(frames=frames)[2].reshape(-1, 17, 2)[:, rows]
    scores = np.full(pixels.shape[:2], 0.9)
    none = np.full(len(scores), np.nan)
    return PicturePeople(pixels, scores, np.full((len(scores), 4), np.nan), none, nameless_skeleton(len(names)))


def chosen(pictures, **options):
    choice = choose_skeletons([pictures], **options)
    return choice.by_count[len(pictures.joints)].name, choice.notes


@pytest.mark.parametrize("name", KNOWN)
def test_of_the_skeletons_with_a_number_of_joints_the_right_one_is_taken(name):
    got, notes = chosen(people(name))
    rivals = [other for other in KNOWN if len(KNOWN[other]) == len(KNOWN[name]) and other != name]
    assert got == name
    assert all(f"skeleton {name}" in note for note in notes)
    assert bool(notes) == bool(rivals)


@pytest.mark.parametrize("seed", range(5))
def test_joints_in_an_unknown_order_are_refused(seed):
    given = people("coco17")
    order = np.random.default_rng(seed).permutation(17)
    mixed = PicturePeople(given.keypoints[:, order], given.scores, given.boxes, given.box_scores, given.joints)
    with pytest.raises(ValueError, match=r"another order than those of a known skeleton.*--skeleton FILE.toml"):
        choose_skeletons([mixed])


def test_a_declared_skeleton_that_another_one_beats_is_refused():
    with pytest.raises(ValueError, match=r"--skeleton: body25 does not fit.*give --skeleton body25b"):
        choose_skeletons([people("body25b")], declared=KNOWN["body25"])
    assert chosen(people("body25b"), declared=KNOWN["body25b"]) == ("body25b", ())


def test_a_declared_skeleton_that_none_beats_is_taken_with_a_note():
    given, order = people("halpe26"), np.random.default_rng(1).permutation(26)
    mixed = PicturePeople(given.keypoints[:, order], given.scores, given.boxes, given.box_scores, given.joints)
    got, notes = chosen(mixed, declared=KNOWN["halpe26"], origin="Config.toml")
    assert got == "halpe26"
    assert notes[0].startswith("Config.toml: halpe26 does not fit")


def test_too_few_people_decide_nothing():
    few = people("body25b", frames=1)
    few = PicturePeople(*(getattr(few, key)[:6] for key in ("keypoints", "scores", "boxes", "box_scores")), few.joints)
    got, notes = chosen(few)
    assert got == "body25"
    assert "too few people tell which" in notes[0]


def test_joints_that_fit_several_skeletons_are_refused():
    """Some pictures in one order, some in another one: no order fits much better than the other."""
    both = [people("crowdpose14"), people("shelf14")]
    with pytest.raises(ValueError, match=r"fit several skeletons.*say which it is, --skeleton"):
        choose_skeletons(both)


def test_real_people_have_the_proportions_of_the_table(shared_data):
    for folder, name in (("shelf/openpose", "body25"), ("pose2sim/body25b/balancing/pose", "body25b")):
        if not (shared_data / folder).is_dir():
            pytest.skip(f"no {folder}")
        bodies = [
            person["pose_keypoints_2d"]
            for file in sorted((shared_data / folder).glob("*/*.json"))[::7]
            for person in json.loads(file.read_text())["people"]
        ]
        values = np.reshape(bodies, (-1, 25, 3))
        for other in ("body25", "body25b"):
            found = deviation(values[..., :2], values[..., 2], KNOWN[other])
            assert (found < 0.5 * FITS) if other == name else (found > 1.8 * FITS)


def test_a_person_without_keypoints_was_not_detected(tmp_path):
    pixels = filmed(frames=3)[2]
    for view in range(2):
        (tmp_path / f"cam{view}").mkdir()
        for frame in range(3):
            bodies = [
                {"pose_keypoints_2d": np.column_stack([p, np.full(17, 0.9)]).ravel().tolist()}
                for p in pixels[frame, view]
            ]
            empty = [{"pose_keypoints_2d": []}] if frame == 1 else []
            content = {"people": empty + bodies}
            (tmp_path / f"cam{view}" / f"{frame}.json").write_text(json.dumps(content))
    frames = read_recording(["cam0", "cam1"], [tmp_path]).detections(np.zeros((3, 2)))
    assert [len(each) for each in frames] == [4, 4, 4]
