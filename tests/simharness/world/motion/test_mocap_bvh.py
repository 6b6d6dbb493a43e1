"""BVH files: poses of a small file computed by hand, and messages about malformed ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.world.motion.mocap.bvh import read_bvh

BVH = """\
HIERARCHY
ROOT Hips
{
	OFFSET 5.0 6.0 7.0
	CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
	JOINT Leg
	{
		OFFSET 1.0 0.0 0.0
		CHANNELS 3 Zrotation Xrotation Yrotation
		End Site
		{
			OFFSET 0.0 -2.0 0.0
		}
	}
	JOINT Arm
	{
		OFFSET 0.0 3.0 0.0
		CHANNELS 1 Xrotation
	}
}
MOTION
Frames: 2
Frame Time: 0.02
10 20 30 0 0 0 0 0 0 0
0 0 0 90 0 0 0 90 0 45
"""


def read(tmp_path, text=BVH):
    path = tmp_path / "clip.bvh"
    path.write_text(text, encoding="utf-8")
    return read_bvh(path)


def test_places_by_hand(tmp_path):
    recording = read(tmp_path)
    assert recording.rate == pytest.approx(50)
    assert recording.duration == pytest.approx(0.02)
    assert recording.skeleton.names == ("Hips", "Leg", "Leg end", "Arm")
    where, _ = recording.pose()
    # The position of the root replaces its offset.
    np.testing.assert_allclose(where[0], [[10, 20, 30], [11, 20, 30], [11, 18, 30], [10, 23, 30]])
    # The root's 90 degrees about z take x to y and y to -x; before that the leg's 90 about x take -y to -z.
    np.testing.assert_allclose(where[1], [[0, 0, 0], [0, 1, 0], [0, 1, -2], [-3, 0, 0]], atol=1e-12)


def test_channels_rotate_about_local_axes_in_their_order(tmp_path):
    text = BVH.replace("0 0 0 90 0 0 0 90 0 45", "0 0 0 90 90 0 0 0 0 0")
    where, _ = read(tmp_path, text).pose()
    # Z then X, each about local axes, is Rz Rx: Rx takes +y to +z, which Rz leaves.
    np.testing.assert_allclose(where[1][3], [0, 0, 3], atol=1e-12)


def test_a_root_without_position_stays_at_its_offset(tmp_path):
    text = BVH.replace("CHANNELS 6 Xposition Yposition Zposition", "CHANNELS 3")
    text = text.replace("10 20 30 ", "").replace("0 0 0 90 0 0 0 90", "90 0 0 0 90")
    where, _ = read(tmp_path, text).pose()
    np.testing.assert_allclose(where[:, 0], [[5, 6, 7], [5, 6, 7]])


def test_positions_of_other_joints_are_ignored(tmp_path):
    text = BVH.replace("CHANNELS 1 Xrotation", "CHANNELS 4 Xposition Yposition Zposition Xrotation")
    text = text.replace("0 0 0 0\n", "0 0 0 8 8 8 0\n").replace("90 0 45\n", "90 0 8 8 8 45\n")
    np.testing.assert_allclose(read(tmp_path, text).pose()[0], read(tmp_path).pose()[0])


def test_braces_and_line_ends_of_other_writers(tmp_path):
    text = BVH.replace("JOINT Leg\n\t{", "JOINT Leg {").replace("\n", "\r\n").replace("Frames: 2", "Frames:\t2")
    np.testing.assert_array_equal(read(tmp_path, text).pose()[0], read(tmp_path).pose()[0])


@pytest.mark.parametrize(
    ("name", "frames", "rate", "height"),
    [
        ("AV_8Walk_Meredith_HVHA_Rep1.bvh", 1064, 120, 32.3),
        ("test_freebvh.bvh", 69, 30, 82.7),
        ("test_mocapbank.bvh", 455, 30, 87.6),
    ],
)
def test_real_files(shared_data, name, frames, rate, height):
    """Leg lengths equal the offsets of knee and ankle in every frame."""
    recording = read_bvh(shared_data / "motion" / "bvh" / name)
    assert len(recording) == frames
    assert recording.rate == pytest.approx(rate, rel=1e-3)
    names = [joint.lower() for joint in recording.skeleton.names]
    hip = next(k for k, joint in enumerate(names) if joint.endswith(("leftupleg", "lefthip")))
    where, _ = recording.pose()
    knee = recording.skeleton.children(hip)[0]
    ankle = recording.skeleton.children(knee)[0]
    length = np.linalg.norm(where[:, hip] - where[:, knee], axis=1) + np.linalg.norm(
        where[:, knee] - where[:, ankle], axis=1
    )
    np.testing.assert_allclose(length, height, atol=0.1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0 0 0 90 0 0 0 90 0 45", "0 0 0 90 0 0 0 90 0", r"clip.bvh, line 25: expected 10 values .*, got 9"),
        ("0 0 0 90 0 0 0 90 0 45", "0 0 0 90 0 0 0 90 0 x", r"clip.bvh, line 25: expected numbers .*, got 'x'"),
        ("0 0 0 90 0 0 0 90 0 45", "0 0 0 inf 0 0 0 90 0 45", r"line 25: expected numbers within .*, got 'inf'"),
        ("0 0 0 90 0 0 0 90 0 45\n", "", r"line 24: Frames: states 2, got 1 lines of values"),
        ("Frames: 2", "Frames: 1", r"line 25: Frames: states 1, got 2 lines of values"),
        ("Frames: 2", "Frames: 0", r"line 22: expected a count of 1 or more after Frames:, got '0'"),
        ("Frames: 2", "Frames: many", r"line 22: expected a count of 1 or more after Frames:, got 'many'"),
        ("Frames: 2", "Frames: 99999999999999999999", r"Frames: states 999999999999999999, got 2 lines"),
        ("Frames: 2\n", "", r"line 22: expected Frames: and a count, got 'Frame Time: 0.02'"),
        ("Frame Time: 0.02", "Frame Time: 0", r"line 23: expected a Frame Time of 0.0001 to 10 s, got 0"),
        ("Frame Time: 0.02", "Frame Time:", r"line 23: expected 1 value for Frame Time, got 0"),
        ("Frame Time: 0.02", "Frame Rate: 50", r"line 23: expected Frame Time: and seconds"),
        ("CHANNELS 3 Zrotation", "CHANNELS 4 Zrotation", r"line 9: CHANNELS of Leg states '4' but lists 3"),
        ("CHANNELS 3 Zrotation", "CHANNELS Zrotation", r"line 9: CHANNELS of Leg states 'Zrotation' but lists 2"),
        ("Zrotation Xrotation Yrotation\n\t\tEnd", "Zrotation Wrotation Yrotation\n\t\tEnd", r"line 9: expected CHANN"),
        ("Xposition Yposition", "Xposition Xposition", r"line 5: expected CHANNELS of Hips to be some of .* each once"),
        ("\t\tOFFSET 1.0 0.0 0.0\n", "", r"line 13: Leg, which begins in line 6, has no OFFSET"),
        ("OFFSET 1.0 0.0 0.0", "OFFSET 1.0 0.0", r"line 8: expected 3 values for OFFSET of Leg, got 2"),
        ("JOINT Arm", "JOINT Leg", r"line 15: the joint 'Leg' is defined twice"),
        ("JOINT Arm", "JOINT", r"line 15: expected a name after JOINT"),
        ("JOINT Arm", "ROOT Arm", r"line 15: a ROOT inside another joint"),
        ("ROOT Hips", "JOINT Hips", r"line 2: a JOINT before the ROOT"),
        ("ROOT Hips\n{", "ROOT Hips\n(", r"line 3: expected \{ alone, got '\('"),
        ("}\nMOTION", "MOTION", r"line 20: expected OFFSET, CHANNELS, JOINT, End Site or \}, got 'MOTION'"),
        ("}\nMOTION", "}\nROOT Other\n{\n}\nMOTION", r"line 21: expected MOTION after the one ROOT, got 'ROOT Other'"),
        (BVH, BVH[: BVH.index("End Site")], r"line \d+: the file ends where a joint or its end was expected"),
        (BVH, "", r"clip.bvh, line 1: the file ends where HIERARCHY was expected"),
        (BVH, "GIF89a", r"clip.bvh, line 1: expected HIERARCHY, got 'GIF89a'; is it a BVH file\?"),
        (BVH, BVH[: BVH.index("MOTION")], r"the file ends where MOTION was expected"),
    ],
)
def test_a_malformed_file_names_the_line(tmp_path, old, new, message):
    assert old in BVH
    with pytest.raises(ValueError, match=message):
        read(tmp_path, BVH.replace(old, new, 1))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


_NOISE = st.sampled_from(["", "{", "}", "\n}\n", "End Site", "JOINT a\n{\n", "MOTION\n", "Frames:", "1e999", "²", "-"])


@given(
    start=st.integers(0, len(BVH)),
    length=st.integers(0, 60),
    noise=st.one_of(_NOISE, st.text(max_size=8)),
    twice=st.booleans(),
)
def test_a_damaged_file_raises_at_most_a_clear_error(folder, start, length, noise, twice):
    """A file that is cut, doubled or overwritten anywhere is read, or a ValueError names it."""
    text = BVH[:start] + (2 * BVH[start : start + length] if twice else noise) + BVH[start + length :]
    try:
        recording = read(folder, text)
    except ValueError as error:
        assert str(error).startswith("clip.bvh")  # noqa: PT017
    else:
        assert np.isfinite(recording.pose()[0]).all()


@given(depth=st.integers(1, 3000))
def test_depth_does_not_matter(folder, depth):
    text = "HIERARCHY\nROOT a0\n{\nOFFSET 0 0 0\n" + "".join(f"JOINT a{k}\n{{\nOFFSET 0 1 0\n" for k in range(1, depth))
    with pytest.raises(ValueError, match=r"clip.bvh, line \d+"):
        read(folder, text)
