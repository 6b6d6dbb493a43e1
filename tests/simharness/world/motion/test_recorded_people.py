"""Recorded people to re-enact: read in every format, and refused with the cause where they cannot be re-enacted."""

import numpy as np
import pytest
from casting import performer

from mvpose.formats.people import FORMATS, write_people
from mvpose.recording import People
from mvpose.skeleton import COCO17
from simharness.scenario.sections.people_section import MocapSection, PeopleSection
from simharness.scenario.sections.scenario import Scenario
from simharness.types.random_streams import stream
from simharness.world.motion.choreography import choreograph
from simharness.world.motion.mocap import load_people

UPRIGHT = np.zeros((17, 3))  # face, shoulders, elbows, wrists, hips, knees, ankles of a person who faces +x
UPRIGHT[:, 2] = [1.6, 1.65, 1.65, 1.6, 1.6, 1.4, 1.4, 1.1, 1.1, 0.85, 0.85, 0.9, 0.9, 0.5, 0.5, 0.1, 0.1]
UPRIGHT[1:, 1] = 0.15 * np.tile([1, -1], 8)
JOINTS = UPRIGHT + stream(1, "tracks").normal(scale=0.01, size=(6, 2, 17, 3))


RECORDED = People(2.0 + np.arange(6) / 25.0, [3, 7], JOINTS)


def load(path, count=2, **motion):
    return load_people(PeopleSection(count=count, motion=MocapSection(file=str(path), **motion)))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "recorded.npz"


@pytest.mark.parametrize("kind", [name for name, each in FORMATS.items() if each.read and each.write])
def test_people_of_every_format_are_re_enacted(tmp_path, kind):
    """Files and folders; times are counted from the first frame."""
    paths = write_people(RECORDED, tmp_path / "people", formats=[kind])
    people = load(tmp_path / "people")
    np.testing.assert_allclose(people.joints, JOINTS, atol=1e-4)
    np.testing.assert_allclose(people.times, np.arange(6) / 25.0, atol=1e-4)
    if kind in ("trc", "c3d"):  # a file for each person
        np.testing.assert_allclose(load(paths[1], count=1).joints[:, 0], JOINTS[:, 1], atol=1e-4)
    scenario = Scenario(name="again", people={"count": 2, "motion": {"file": str(tmp_path / "people")}})
    motions = choreograph(scenario, [performer(0), performer(1)], np.arange(5) / 25.0).motions
    places = [motion.root[:, :2].mean(axis=0) for motion in motions]
    np.testing.assert_allclose(places, JOINTS[:, :, 11:13, :2].mean(axis=(0, 2)), atol=0.15)


def test_named_joints_may_have_another_order(path):
    order = stream(2, "order").permutation(17)
    np.savez(path, joints=JOINTS[:, :, order], rate=25.0, names=np.array(COCO17.joints)[order])
    np.testing.assert_array_equal(load(path).joints, JOINTS)


def test_joints_without_names_are_those_of_coco(path):
    np.savez(path, joints=JOINTS, rate=25.0)
    people = load(path)
    np.testing.assert_array_equal(people.joints, JOINTS)
    np.testing.assert_array_equal(people.times, np.arange(6) / 25.0)


def changed(frame: int, person: int, joint: str, value: object) -> np.ndarray:
    joints = JOINTS.copy()
    joints[frame, person, COCO17.index(joint)] = value
    return joints


RIGHT_HIP = JOINTS[3, 0, COCO17.index("right_hip")]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"rate": 25.0}, "has no array 'joints'"),
        ({"joints": JOINTS}, "states neither the times of frames nor frames per second"),
        ({"joints": JOINTS[:, 0], "rate": 25.0}, r"joints must be \(T, P, J, 3\), got \(6, 17, 3\)"),
        ({"joints": JOINTS[:, :, :14], "rate": 25.0}, "has 14 joints, but skeleton coco17 has 17"),
        ({"joints": JOINTS[:0], "rate": 25.0}, "has 0 frames of 2 people, expected one or more of each"),
        (
            {"joints": changed(4, 1, "left_wrist", np.nan), "rate": 25.0},
            "got 1 that are absent, the first one left_wrist of person 1 in frame 4",
        ),
        ({"joints": 1000 * JOINTS, "rate": 25.0}, r"the trunk of person 0 is (49|50)\d m long .* joints in metres"),
        (
            {"joints": changed(3, 0, "left_hip", RIGHT_HIP), "rate": 25.0},
            "left and right hip of person 0 .* in frame 3",
        ),
        ({"joints": JOINTS, "rate": 0.0}, "rate must be one positive number of frames per second, got 0.0"),
        ({"joints": JOINTS, "rate": np.nan}, "rate must be one positive number of frames per second, got nan"),
        ({"joints": JOINTS, "rate": [25.0, 30.0]}, "rate must be one positive number"),
        ({"joints": JOINTS, "rate": "fast"}, "rate must be one positive number"),
        ({"joints": JOINTS, "rate": 25.0, "names": ["nose"]}, "has 17 joints, but skeleton recorded.npz has 1"),
        (
            {"joints": JOINTS, "rate": 25.0, "names": [*COCO17.joints[:16], "tail"]},
            "got 12 that are absent, the first one right_ankle",
        ),
    ],
)
def test_wrong_content_is_refused(path, content, message):
    np.savez(path, **content)
    with pytest.raises(ValueError, match=rf"recorded.npz: .*{message}"):
        load(path)


def test_other_files_are_refused(path):
    with pytest.raises(ValueError, match=r"recorded.npz: no such file; expected a NumPy archive \(npz\) with joints"):
        load(path)
    path.write_text("joints")
    with pytest.raises(ValueError, match=r"recorded.npz: cannot be read .* expected a NumPy archive"):
        load(path)


def test_the_number_of_people_and_the_start_must_fit(path):
    np.savez(path, joints=JOINTS, rate=25.0)
    assert len(load(path, start=0.2)) == 2
    with pytest.raises(ValueError, match=r"people.count = 3, but .*recorded.npz has 2 people"):
        load(path, count=3)
    with pytest.raises(ValueError, match=r"people.motion.start = 0.3 s is not within .*: expected 0 to 0.2 s"):
        load(path, start=0.3)


def test_everybody_re_enacts(path):
    motion = MocapSection(file=str(path))
    assert PeopleSection(motion=motion).activities == ("mocap",)
    with pytest.raises(ValueError, match=r"people.activities = \[\"mocap\"\] with the recorded people"):
        PeopleSection(activities=("mocap", "walk"), motion=motion)
