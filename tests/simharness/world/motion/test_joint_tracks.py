"""Files of joint tracks: what is written is read, and wrong content is refused with its cause."""

import numpy as np
import pytest

from mvpose.skeleton import COCO17
from simharness.scenario.sections.people_section import MocapSection, PeopleSection
from simharness.types.random_streams import stream
from simharness.world.motion.mocap.joint_tracks import load_tracks, read_joint_tracks, tracks_file

UPRIGHT = np.zeros((17, 3))  # face, shoulders, elbows, wrists, hips, knees, ankles of a person who faces +x
UPRIGHT[:, 2] = [1.6, 1.65, 1.65, 1.6, 1.6, 1.4, 1.4, 1.1, 1.1, 0.85, 0.85, 0.9, 0.9, 0.5, 0.5, 0.1, 0.1]
UPRIGHT[1:, 1] = 0.15 * np.tile([1, -1], 8)
JOINTS = UPRIGHT + stream(1, "tracks").normal(scale=0.01, size=(6, 2, 17, 3))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "tracks.npz"


def test_a_written_file_is_read(path):
    tracks_file(path, JOINTS, 25)
    tracks = read_joint_tracks(path)
    np.testing.assert_array_equal(tracks.joints, JOINTS)
    assert (tracks.rate, tracks.people, tracks.duration) == (25.0, 2, 0.2)


def test_named_joints_may_have_another_order(path):
    order = stream(2, "order").permutation(17)
    np.savez(path, joints=JOINTS[:, :, order], rate=25.0, names=np.array(COCO17.joints)[order])
    np.testing.assert_array_equal(read_joint_tracks(path).joints, JOINTS)


def changed(frame: int, person: int, joint: str, value: object) -> np.ndarray:
    joints = JOINTS.copy()
    joints[frame, person, COCO17.index(joint)] = value
    return joints


RIGHT_HIP = JOINTS[3, 0, COCO17.index("right_hip")]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"rate": 25.0}, "has no array 'joints'"),
        ({"joints": JOINTS}, "has no array 'rate'"),
        ({"joints": JOINTS[:, 0], "rate": 25.0}, r"expected joints \(T, P, 17, 3\).* got float64 \(6, 17, 3\)"),
        ({"joints": JOINTS[:, :, :14], "rate": 25.0}, r"got float64 \(6, 2, 14, 3\)"),
        ({"joints": JOINTS[:0], "rate": 25.0}, r"of one or more frames and people, got float64 \(0, 2, 17, 3\)"),
        ({"joints": JOINTS > 0, "rate": 25.0}, "got bool"),
        (
            {"joints": changed(4, 1, "left_wrist", np.nan), "rate": 25.0},
            "got 1 that are not, the first one left_wrist of person 1 in frame 4",
        ),
        ({"joints": 1000 * JOINTS, "rate": 25.0}, r"the trunk of person 0 is (49|50)\d m long .* joints in metres"),
        (
            {"joints": changed(3, 0, "left_hip", RIGHT_HIP), "rate": 25.0},
            "left and right hip of person 0 .* in frame 3",
        ),
        ({"joints": JOINTS, "rate": 0.0}, "expected a positive rate in frames per second, got 0.0"),
        ({"joints": JOINTS, "rate": np.nan}, "expected a positive rate in frames per second, got nan"),
        ({"joints": JOINTS, "rate": [25.0, 30.0]}, "expected rate, one number"),
        ({"joints": JOINTS, "rate": "fast"}, "expected rate, one number"),
        (
            {"joints": JOINTS, "rate": 25.0, "names": ["nose"]},
            "expected names to be those of the joints, nose, left_eye",
        ),
    ],
)
def test_wrong_content_is_refused(path, content, message):
    np.savez(path, **content)
    with pytest.raises(ValueError, match=rf"tracks.npz: .*{message}"):
        read_joint_tracks(path)


def test_other_files_are_refused(path):
    with pytest.raises(ValueError, match=r"tracks.npz: no such file; expected a NumPy archive \(npz\) with joints"):
        read_joint_tracks(path)
    path.write_text("joints")
    with pytest.raises(ValueError, match=r"tracks.npz: cannot be read .* expected a NumPy archive"):
        read_joint_tracks(path)


def test_the_number_of_people_and_the_start_must_fit(path):
    tracks_file(path, JOINTS, 25)
    motion = MocapSection(file=str(path), start=0.2)
    assert load_tracks(PeopleSection(count=2, motion=motion)).people == 2
    with pytest.raises(ValueError, match=r"people.count = 3, but .*tracks.npz has the tracks of 2 people"):
        load_tracks(PeopleSection(count=3, motion=motion))
    with pytest.raises(ValueError, match=r"people.motion.start = 0.3 s is not within .*: expected 0 to 0.2 s"):
        load_tracks(PeopleSection(count=2, motion=MocapSection(file=str(path), start=0.3)))


def test_everybody_re_enacts(path):
    motion = MocapSection(file=str(path))
    assert PeopleSection(motion=motion).activities == ("mocap",)
    with pytest.raises(ValueError, match=r"people.activities = \[\"mocap\"\] with the joint tracks"):
        PeopleSection(activities=("mocap", "walk"), motion=motion)
