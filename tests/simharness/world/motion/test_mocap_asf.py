"""ASF and AMC files: poses of small files computed by hand, and messages about malformed ones."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.world.motion.mocap.asf import RATE, read_amc, read_asf

ASF = """\
# a small one
:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:documentation
   nothing
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 1 2 3
   orientation 0 0 0
:bonedata
  begin
     id 1
     name thigh
     direction 0 -2 0
     length 3
     axis 0 0 90  XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name shin
     direction 0 -1 0
     length 2
     axis 0 0 0 XYZ
     dof rx
  end
  begin
     id 3
     name spine
     direction 0 1 0
     length 4
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root thigh spine
    thigh shin
  end
"""
AMC = """\
#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 10 20 30 0 0 0
thigh 0 0 0
shin 0
2
root 0 0 0 0 90 0
thigh 90 0 0
shin 90
"""


@pytest.fixture
def files(tmp_path):
    def write(asf: str = ASF, amc: str = AMC) -> tuple[Path, Path]:
        (tmp_path / "walk.asf").write_text(asf)
        (tmp_path / "walk.amc").write_text(amc)
        return tmp_path / "walk.asf", tmp_path / "walk.amc"

    return write


def places(files, asf=ASF, amc=AMC) -> dict[str, np.ndarray]:
    skeleton, motion = files(asf, amc)
    recording = read_amc(motion, read_asf(skeleton))
    where, _ = recording.pose()
    return {name: where[:, k] for k, name in enumerate(recording.skeleton.names)}


def test_zero_pose(files):
    """Bones start at the ends of their parents; the position of the root is added to its translation."""
    found = places(files)
    np.testing.assert_allclose(found["root"][0], [11, 22, 33])
    np.testing.assert_allclose(found["thigh"][0], [11, 22, 33])
    np.testing.assert_allclose(found["shin"][0], [11, 19, 33])
    np.testing.assert_allclose(found["shin end"][0], [11, 17, 33])
    np.testing.assert_allclose(found["spine end"][0], [11, 26, 33])


def test_turned_pose(files):
    """The local x axis of the thigh is y, because its axes are rotated by 90 degrees about z; -y stays."""
    found = places(files)
    np.testing.assert_allclose(found["root"][1], [1, 2, 3])
    np.testing.assert_allclose(found["shin"][1], [1, 2 - 3, 3], atol=1e-12)
    # The rotation of the shin takes -y to -z; the thigh's, 90 about y, -z to -x; the root's, 90 about y, -x to +z.
    np.testing.assert_allclose(found["shin end"][1], [1, -1, 3 + 2], atol=1e-12)
    np.testing.assert_allclose(found["spine end"][1], [1, 2 + 4, 3], atol=1e-12)


def test_angles_act_in_the_listed_order_about_fixed_axes(files):
    amc = AMC.replace("thigh 90 0 0\nshin 90", "thigh 0 0 0\nshin 0").replace("root 0 0 0 0 90 0", "root 0 0 0 90 90 0")
    found = places(files, amc=amc)
    # x first: +y goes to +z; then y: +z goes to +x.
    np.testing.assert_allclose(found["spine end"][1] - found["root"][1], [4, 0, 0], atol=1e-12)


def test_radians(files):
    degrees = places(files)
    amc = AMC.replace(":DEGREES", ":RADIANS").replace("90", repr(np.pi / 2))
    for name, where in places(files, amc=amc).items():
        np.testing.assert_allclose(where, degrees[name], atol=1e-9)
    asf = ASF.replace("angle deg", "angle rad").replace("axis 0 0 90", f"axis 0 0 {np.pi / 2!r}")
    for name, where in places(files, asf=asf, amc=amc.replace(":RADIANS\n", "")).items():
        np.testing.assert_allclose(where, degrees[name], atol=1e-9)


def test_an_excerpt_may_begin_anywhere_and_lines_may_end_in_any_way(files):
    whole = places(files)
    amc = AMC.replace("\n1\n", "\n130\n").replace("\n2\n", "\n131\n").replace("\n", "\r\n")
    for name, where in places(files, amc=amc).items():
        np.testing.assert_array_equal(where, whole[name])


def test_a_recording_of_cmu(shared_data):
    """Subject 02 walks: 343 frames at 120 Hz, at 1 to 1.6 m/s with a leg of 84 cm (a unit is an inch over 0.45)."""
    folder = shared_data / "motion" / "cmu" / "02"
    recording = read_amc(folder / "02_01.amc", read_asf(folder / "02.asf"))
    assert len(recording) == 343
    assert recording.rate == RATE
    names = recording.skeleton.names
    where, turns = recording.pose()
    inch = 0.0254 / 0.45
    leg = np.linalg.norm(recording.skeleton.offsets[[names.index("ltibia"), names.index("lfoot")]], axis=1).sum() * inch
    assert 0.80 < leg < 0.88
    way = np.linalg.norm(where[-1, 0, [0, 2]] - where[0, 0, [0, 2]]) * inch
    assert 1.0 < way / recording.duration < 1.6
    lengths = np.linalg.norm(where[:, 1:] - where[:, recording.skeleton.parents[1:]], axis=-1)
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape), atol=1e-9)
    np.testing.assert_allclose(turns @ turns.swapaxes(-1, -2), np.broadcast_to(np.eye(3), turns.shape), atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("shin 90", "shin", r"walk.amc, line 11: expected 1 value for shin \(rx\), got 0"),
        ("thigh 90 0 0", "thigh 90 0", r"walk.amc, line 10: expected 3 values for thigh \(rx ry rz\), got 2"),
        ("thigh 90 0 0", "thigh 90 O 0", r"walk.amc, line 10: expected numbers for thigh .*, got 'O'"),
        ("thigh 90 0 0", "thigh 90 nan 0", r"walk.amc, line 10: expected numbers within .*, got 'nan'"),
        ("thigh 90 0 0", "thigh 90 1e300 0", r"line 10: expected numbers within"),
        ("thigh 90 0 0\n", "", r"walk.amc, line 8: frame 2 has no values for thigh"),
        (
            "thigh 90 0 0\n",
            "tihgh 90 0 0\n",
            r"line 10: the skeleton has no bone 'tihgh' that moves; it has root, thigh",
        ),
        ("thigh 90 0 0\n", "spine 90 0 0\n", r"line 10: the skeleton has no bone 'spine' that moves"),
        ("shin 90", "shin 90\nshin 90", r"line 12: shin appears twice in one frame"),
        ("\n2\n", "\n3\n", r"line 8: expected the number of frame 2 alone, got '3'"),
        ("\n1\n", "\n1 1\n", r"line 4: expected the number of the first frame alone, got '1 1'"),
        ("\n1\n", "\n", r"line 4: expected the number of the first frame alone"),
        (AMC, ":DEGREES\n", r"walk.amc: has no frames; is it an AMC file\?"),
        (AMC, "", r"walk.amc: has no frames"),
    ],
)
def test_a_malformed_motion_names_the_line(files, old, new, message):
    assert old in AMC
    skeleton, motion = files(amc=AMC.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_amc(motion, read_asf(skeleton))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("     length 3\n", "", r"walk.asf, line 16: the bone that begins here has no length"),
        ("     name thigh\n", "", r"walk.asf, line 16: the bone that begins here has no name"),
        ("direction 0 -2 0", "direction 0 -2", r"line 19: expected 3 values for direction, got 2"),
        ("direction 0 -2 0", "direction 0 0 0", r"line 19: expected a direction, got a vector of length 0"),
        ("length 3", "length -3", r"line 20: expected a length of 0 or more, got -3"),
        ("length 3", "length three", r"line 20: expected numbers for length, got 'three'"),
        ("axis 0 0 90  XYZ", "axis 0 0 90", r"line 21: expected the order of the axes, such as XYZ, got ''"),
        ("axis 0 0 90  XYZ", "axis 0 0 90 XXZ", r"line 21: expected the order of the axes"),
        ("axis 0 0 90  XYZ", "axis 0 90 XYZ", r"line 21: expected numbers for axis, got 'XYZ'"),
        ("dof rx ry rz", "dof rx ry l", r"line 22: expected dof to be some of rx ry rz, got 'rx ry l'"),
        ("dof rx ry rz", "dof rx rx", r"line 22: expected dof to be some of"),
        ("angle deg", "angle grad", r"line 7: expected angle deg or rad, got 'grad'"),
        ("order TX TY TZ RX RY RZ", "order TX TY QX", r"line 11: expected an order of TX TY TZ RX RY RZ"),
        ("position 1 2 3", "position 1 2", r"line 13: expected 3 values for the root's position, got 2"),
        ("position 1 2 3", "placing 1 2 3", r"line 13: expected order, axis, position or orientation, got 'placing'"),
        ("     name shin", "     name thigh", r"line 29: the bone 'thigh' is defined twice"),
        ("    root thigh spine\n", "    root thigh\n", r"line 37: bone 'spine' has no parent in :hierarchy"),
        ("thigh shin", "thigh shank", r"line 45: :bonedata has no bone 'shank'"),
        ("thigh shin", "thigh shin spine", r"line 45: spine already has a parent"),
        (
            "root thigh spine\n    thigh shin",
            "root spine\n    thigh shin\n    shin thigh",
            r"is not connected to the root",
        ),
        ("     dof rx\n  end\n", "     dof rx\n", r"line 34: the bone that begins in line 27 has no end"),
        (":hierarchy", ":hierarchies", r"walk.asf: has no section :hierarchy; is it an ASF file\?"),
        (ASF, "HIERARCHY\nROOT Hips", r"walk.asf, line 1: expected a section such as :bonedata, got 'HIERARCHY'"),
        (ASF, "", r"walk.asf: has no section :root"),
    ],
)
def test_a_malformed_skeleton_names_the_line(files, old, new, message):
    assert old in ASF
    skeleton, _ = files(asf=ASF.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_asf(skeleton)


def test_a_missing_file(tmp_path):
    with pytest.raises(ValueError, match=r"none.asf: no such file"):
        read_asf(tmp_path / "none.asf")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


_NOISE = st.sampled_from(
    ["", " ", "\n", "end\n", "begin\n", ":", "-", "1e999", "nan", "root", "٣", "\x00", "begin end"]
)


@given(data=st.data())
def test_a_damaged_file_raises_at_most_a_clear_error(folder, data):
    """A file that is cut, doubled or overwritten anywhere is read, or a ValueError names it."""
    texts = {"walk.asf": ASF, "walk.amc": AMC}
    for name, text in texts.items():
        start = data.draw(st.integers(0, len(text)), label=f"{name} from")
        stop = data.draw(st.integers(start, min(start + 40, len(text))), label=f"{name} to")
        noise = data.draw(st.one_of(_NOISE, st.text(max_size=8), st.just(text[start:stop] * 2)), label=f"{name} noise")
        (folder / name).write_text(text[:start] + noise + text[stop:], encoding="utf-8")
    try:
        recording = read_amc(folder / "walk.amc", read_asf(folder / "walk.asf"))
    except ValueError as error:
        assert str(error).startswith(("walk.asf", "walk.amc"))  # noqa: PT017
    else:
        assert np.isfinite(recording.pose()[0]).all()
