"""Mends of a calibration: what is applied is what the doctor examined, and a wrong one ends in a message."""

from dataclasses import replace

import numpy as np
import pytest
from moving_people import film, walk
from people import look_at
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.calibration import diagnose
from mvpose.calibration.file_mistakes import CHANGES
from mvpose.calibration.mends import AXES, MENDS, Mend, axis_vector, of_pictures, upright
from mvpose.calibration.repair import mended
from mvpose.formats.detections.plausibility import turned_up

_PLACES = ((4.0, 0.3, 2.1), (1.0, 3.8, 1.6), (-3.3, 2.4, 2.6), (-2.6, -3.2, 1.9))
_PERIOD = 0.1
LENS = Camera(
    np.array([[900.0, 2.0, 500.0], [0.0, 950.0, 400.0], [0.0, 0.0, 1.0]]),
    Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix(),
    np.array([0.1, 0.2, 5.0]),
    np.array([-0.2, 0.05, 0.01, -0.02, 0.01]),
    (1000, 800),
    "a",
)


@pytest.fixture(scope="module")
def recording():
    rig = Rig([look_at(np.array(at), np.array([0.1 * v, 0.0, 1.0]), name=f"c{v}") for v, at in enumerate(_PLACES)])
    return rig, film(rig, walk(3, frames=40, period=_PERIOD), noise=2.0)[0]


def inverted(camera):
    return replace(camera, R=camera.R.T, t=camera.center)


def in_millimetres(camera):
    return replace(camera, t=1000.0 * camera.t)


def in_one(change, view=1):
    return lambda cameras: [change(each) if v == view else each for v, each in enumerate(cameras)]


def in_all(change):
    return lambda cameras: [change(each) for each in cameras]


def exchanged(cameras):
    a, b, *rest = cameras
    return [replace(b, name=a.name), replace(a, name=b.name), *rest]


def half_resolution(camera):
    return replace(camera, K=camera.K * [[0.5], [0.5], [1.0]])


def half_size(camera):
    return replace(camera, size=(camera.size[0] // 2, camera.size[1] // 2))


BROKEN = {
    "millimetres in all": (in_all(in_millimetres), "wrong-unit", None, ("--mend", "unit:0.001")),
    "millimetres in one": (in_one(in_millimetres), "wrong-unit", "c1", ("--mend", "unit:0.001@c1")),
    "inverted in one": (in_one(inverted), "extrinsics-inverted", "c1", ("--mend", "inverted@c1")),
    "inverted and exchanged": (
        lambda cameras: exchanged(in_all(inverted)(cameras)), "extrinsics-inverted", None, None,
    ),
    "K of half the resolution": (in_all(half_resolution), "image-size", None, ("--mend", "resolution:2")),
    "half the size": (in_all(half_size), "picture-size", None, ("--mend", "size:1280x960")),
    "upside down": (
        in_all(lambda camera: replace(camera, R=camera.R @ np.diag([1.0, -1.0, -1.0]))), "world-turned", None,
        ("--mend", "up:-z"),
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN)
def test_the_printed_mend_gives_back_the_rig(recording, name):
    """Whatever the mistake, also where the cameras make no rig: its mend is named, and undoes it."""
    rig, frames = recording
    change, kind, camera, options = BROKEN[name]
    broken = Rig.unchecked(change(list(rig)))
    diagnosis = diagnose(broken, frames, period=_PERIOD)
    assert (kind, camera) in [(each.kind, each.camera) for each in diagnosis.alarms]
    assert options in (None, diagnosis.repair)
    assert "=" not in "".join(each.mend for each in diagnosis.findings)  # words, no code
    for one, other in zip(mended(broken, frames, diagnosis.repair, period=_PERIOD).rig, rig, strict=True):
        assert (one.name, one.size) == (other.name, other.size)
        np.testing.assert_allclose(one.K, other.K, rtol=1e-3, atol=1.0)
        np.testing.assert_allclose(one.R, other.R, atol=1e-9)
        np.testing.assert_allclose(one.t, other.t, atol=1e-9)


def test_an_axis_that_the_user_gives_wrongly_is_named(recording):
    rig, frames = recording
    (found,) = diagnose(rig, frames, period=_PERIOD, up="-y").alarms
    assert found.kind == "world-turned"
    assert found.mend == "--up=-y is wrong: give --up=z instead"
    assert found.repair == ()


def test_cameras_below_the_floor_are_named():
    """The same pictures of people and cameras that are mirrored in the floor: nobody is seen from below the ground."""
    low = Rig(
        [look_at(np.array([x, y, -z]), np.array([0.0, 0.0, 1.0]), name=f"c{v}") for v, (x, y, z) in enumerate(_PLACES)]
    )
    frames, _ = film(low, walk(3, frames=40, period=_PERIOD), noise=2.0)
    assert any("below the floor" in each.text for each in diagnose(low, frames, period=_PERIOD).alarms)


def packed(camera):
    K = camera.K
    return np.concatenate(
        [[K[0, 0], K[0, 1], K[0, 2], K[1, 1], K[1, 2]], camera.R.ravel(), camera.center, camera.distortion]
    )


@pytest.mark.parametrize(
    "number", [k for k, (_, change) in enumerate(CHANGES) if change(packed(LENS), LENS.size)[1] is not None]
)
def test_a_camera_of_other_pictures_projects_into_them(number):
    """The map of pixels of every mistake: scaled, turned, mirrored, with all terms of the lens."""
    points = LENS.center + (np.random.default_rng(0).normal(size=(20, 3)) * [0.3, 0.3, 0.1] + [0, 0, 4]) @ LENS.R
    pixels = CHANGES[number][1](packed(LENS), LENS.size)[1]
    other = of_pictures(LENS, pixels)
    mirror = np.diag([-1.0 if np.linalg.det(pixels[:, :2]) < 0 else 1.0, 1.0, 1.0])
    detected = other.project(points @ mirror)
    np.testing.assert_allclose(detected @ pixels[:, :2].T + pixels[:, 2], LENS.project(points), atol=1e-9)


@pytest.mark.parametrize("axis", AXES)
def test_the_world_is_turned_as_by_the_option(axis):
    rig = Rig([LENS, replace(LENS, t=LENS.t + 1.0, name="b")])
    for one, other in zip(Mend("up", axis).applied(rig), turned_up(rig, axis), strict=True):
        np.testing.assert_allclose(one.R, other.R, atol=1e-12)
    np.testing.assert_allclose(upright(axis_vector(axis)) @ axis_vector(axis), [0, 0, 1], atol=1e-12)


VALUES = {
    "FACTOR": "0.5",
    "TIMES": "2",
    "WIDTHxHEIGHT": "640x480",
    "X,Y": "3,-4",
    "CHANGE": "-0.1",
    "X,Y,Z": "1,2,3",
    "AXIS": "-y",
}


@pytest.mark.parametrize("name", MENDS)
def test_texts_of_mends_come_back(name):
    values = VALUES.get(MENDS[name].takes, "")
    cameras = () if name in ("mirrored", "up") else ("cam 1", "cam-2")
    mend = Mend(name, values, cameras)
    assert Mend.parsed(str(mend)) == mend


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("turned over", "expected NAME"),
        ("unit", "unit:FACTOR"),
        ("unit:-1", "unit:FACTOR"),
        ("inverted:3", "takes no values"),
        ("center:1,2,3", "center:X,Y"),
        ("exchanged@a", "two cameras"),
        ("up:-z@a", "all cameras together"),
    ],
)
def test_what_no_mend_is_ends_in_a_message(text, said):
    with pytest.raises(ValueError, match=said) as caught:
        Mend.parsed(text)
    assert str(caught.value).startswith(f"--mend {text}: ")


def test_a_camera_that_is_not_there_ends_in_a_message():
    with pytest.raises(ValueError, match="there is no camera 'c'; expected some of a, b"):
        Mend.parsed("inverted@c").applied([LENS, replace(LENS, name="b")])
