"""The registry of calibration formats: a format is one module and one registration."""

from pathlib import Path

import numpy as np
import pytest

from mvpose import Camera, Rig
from mvpose.formats.calibration import calibration_formats
from mvpose.formats.calibration.calibration_file import CalibrationFile, CalibrationFormat
from mvpose.formats.calibration.calibration_formats import read_calibration, register

LINES = "toy calibration\nleft 500 0 0\nright 500 1 0\nback 500 1 1\n"


def read_toy(path: Path, *, size, only):
    """Cameras that look along z: a name, a focal length in pixels and a place in metres on each line."""
    cameras = []
    for line in path.read_text().splitlines()[1:]:
        name, focal, x, y = line.split()
        K = np.array([[float(focal), 0, size[0] / 2], [0, float(focal), size[1] / 2], [0, 0, 1]])
        cameras.append(Camera(K=K, R=np.eye(3), t=-np.array([float(x), float(y), 0]), size=size, name=name))
    return Rig(cameras)


TOY = CalibrationFormat("Toy (text)", lambda file: file.content.startswith(b"toy"), read_toy)


@pytest.fixture
def toy_file(tmp_path, monkeypatch):
    monkeypatch.setattr(calibration_formats, "FORMATS", list(calibration_formats.FORMATS))
    path = tmp_path / "rig.toy"
    path.write_text(LINES)
    return path


def test_a_registered_format_is_read_with_the_requested_cameras(toy_file):
    register(TOY)
    rig = read_calibration(toy_file, size=(640, 480))
    assert [camera.name for camera in rig] == ["left", "right", "back"]
    assert rig[1].size == (640, 480)
    chosen = read_calibration(toy_file, size=(640, 480), only=("back", "left"))
    np.testing.assert_allclose(chosen.centers, [[1, 1, 0], [0, 0, 0]])
    with pytest.raises(ValueError, match=r"rig\.toy: cameras\.only: the rig has no camera 'bakc'; did you mean 'back'"):
        read_calibration(toy_file, size=(640, 480), only=("bakc", "left"))


def test_the_message_about_an_unknown_file_lists_what_is_registered(toy_file):
    toy_file.write_text("something else")
    with pytest.raises(ValueError, match="expected one of Panoptic") as before:
        read_calibration(toy_file, size=(640, 480))
    register(TOY)
    with pytest.raises(ValueError, match=r"expected one of Toy \(text\), Panoptic") as after:
        read_calibration(toy_file, size=(640, 480))
    for name in (each.name for each in calibration_formats.FORMATS[1:]):
        assert name in str(before.value)
        assert name in str(after.value)


def test_every_shipped_format_recognises_what_it_writes(tmp_path):
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    rig = Rig([Camera(K=K, R=np.eye(3), t=np.array([k, 0.0, 2.0]), size=(640, 480), name=f"c{k}") for k in (0, 1)])
    written = [each for each in calibration_formats.FORMATS if each.write is not None]
    assert len(written) >= 5
    for each in written:
        folder = tmp_path / each.name
        folder.mkdir()
        each.write(folder / "rig.yml", rig)
        for file in folder.iterdir():
            assert each.recognises(CalibrationFile(file))
            np.testing.assert_allclose(read_calibration(file, size=(640, 480)).packed, rig.packed, atol=1e-9)
