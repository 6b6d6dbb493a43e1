"""People who were written in any format are read as they were."""

from dataclasses import replace

import numpy as np
import pytest

from mvpose import COCO17
from mvpose.formats.joint_names import JointNames, skeleton_of, to_skeleton
from mvpose.formats.people import FORMATS, Options, read_people, write_people
from mvpose.recording import People
from mvpose.skeleton import PANOPTIC19
from mvpose.wholebody import skeleton_by_name

READ_AND_WRITTEN = [name for name, each in FORMATS.items() if each.read and each.write]
TRACKER = skeleton_of(JointNames("tracker", ("LHip", "tail", "neck")))
SKELETONS = (COCO17, PANOPTIC19, skeleton_by_name("halpe26"), TRACKER)
WITH_SCORES = ("parquet", "csv", "json", "npz", "panoptic")
WITH_COVARIANCES = ("parquet", "csv")


def people_of(skeleton, *, frames=9, rate=30.0):
    """Return two people, of whom one joint is absent in one frame, and one person in another."""
    shape = frames, 2, len(skeleton)
    rng = np.random.default_rng(4)
    joints = rng.uniform(-2, 2, (*shape, 3))
    joints[3, 0, 2], joints[5, 1] = np.nan, np.nan
    covariance = np.eye(3) * rng.uniform(1e-4, 1e-3, (*shape, 1, 1))
    scores = rng.uniform(0.3, 1.0, shape)
    return People(np.arange(frames) / rate, np.array([1, 12]), joints, scores, covariance, skeleton)


def same(found, people, *, kind):
    assert found.ids.tolist() == people.ids.tolist()
    np.testing.assert_allclose(found.times, people.times, atol=1e-4)
    np.testing.assert_allclose(found.joints, people.joints, atol=1e-4, equal_nan=True)
    np.testing.assert_array_equal(found.present, people.present)
    if kind in WITH_SCORES:
        np.testing.assert_allclose(found.scores, people.scores, atol=1e-4)
    if kind in WITH_COVARIANCES:
        np.testing.assert_allclose(found.covariance, people.covariance, atol=1e-9, equal_nan=True)
    assert [len(found.skeleton), found.frames] == [len(people.skeleton), people.frames]


@pytest.mark.parametrize("skeleton", SKELETONS, ids=lambda each: each.name)
@pytest.mark.parametrize("kind", READ_AND_WRITTEN)
def test_what_was_written_is_read(tmp_path, kind, skeleton):
    people = people_of(skeleton)
    if (kind, skeleton.name) in (("panoptic", "halpe26"), ("panoptic", "tracker")):
        pytest.skip("files of Panoptic do not name their joints")
    paths = write_people(people, tmp_path, formats=[kind])
    for given in (tmp_path, paths if kind in ("trc", "c3d") else paths[0].parent if kind == "panoptic" else paths[0]):
        found = read_people(given)
        same(found, people, kind=kind)
        if skeleton in SKELETONS[:3]:
            assert found.skeleton == skeleton


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("kind", ["trc", "c3d", "json", "npz", "parquet"])
def test_either_axis_may_point_up(tmp_path, kind, up):
    people = people_of(COCO17)
    write_people(people, tmp_path, formats=[kind], options=Options(up=up))
    same(read_people(tmp_path, up=up), people, kind=kind)
    if kind in ("c3d", "json"):  # they say it themselves
        same(read_people(tmp_path), people, kind=kind)


def test_all_people_of_one_c3d_file(tmp_path):
    people = people_of(COCO17)
    write_people(people, tmp_path, formats=["c3d"], options=Options(together=True))
    same(read_people(tmp_path), people, kind="c3d")


@pytest.mark.parametrize("kind", ["json", "npz", "panoptic"])
def test_numbers_of_frames_are_kept(tmp_path, kind):
    people = people_of(COCO17).numbered_from(300)
    write_people(people, tmp_path, formats=[kind])
    assert read_people(tmp_path).numbers.tolist() == list(range(300, 309))


def test_of_a_folder_with_several_formats_one_is_read_that_holds_everything(tmp_path):
    people = people_of(COCO17)
    write_people(people, tmp_path, formats=["trc", "csv", "json"])
    np.testing.assert_allclose(read_people(tmp_path).scores, people.scores, atol=1e-6)


def test_joints_are_converted_by_their_names(tmp_path):
    people = people_of(PANOPTIC19)
    write_people(people, tmp_path, formats=["trc"])
    found = to_skeleton(read_people(tmp_path), COCO17)
    for joint in ("nose", "left_hip", "right_ear"):
        wanted = people.joints[:, :, PANOPTIC19.index(joint)]
        np.testing.assert_allclose(found.joints[:, :, COCO17.index(joint)], wanted, atol=1e-4, equal_nan=True)
    with pytest.raises(ValueError, match="has no joint of coco17: it has tail"):
        to_skeleton(replace(people_of(TRACKER), skeleton=replace(TRACKER, joints=("tail", "x", "y"))), COCO17)


def test_other_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"people\.xyz: expected people over time, \*\.parquet, \*\.json"):
        read_people(tmp_path / "people.xyz")
    with pytest.raises(
        ValueError, match=r"has no files of people; expected a folder that `mvpose estimate --out` made"
    ):
        read_people(tmp_path)
    with pytest.raises(ValueError, match="'bvh' cannot be read; expected one of parquet, json"):
        read_people(tmp_path, format="bvh")
    (tmp_path / "people.json").write_text('{"skeleton": {"name": "x", "joints": []}, "frames": []}')
    with pytest.raises(ValueError, match=r"people\.json: .*expected people\.json of mvpose"):
        read_people(tmp_path)
