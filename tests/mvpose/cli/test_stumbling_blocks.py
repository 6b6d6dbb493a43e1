"""What a lab stumbled over: wrong files end in one line that says what to mend, and in no folder."""

from dataclasses import replace

import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim

NAMES = ["cam0", "cam1", "cam2", "cam3"]
TO_Y_UP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # x, y, z of ours from z, x, y of the file


def without_camera_3(pixels):
    return np.where(np.arange(4)[None, :, None, None, None] == 3, np.nan, pixels)


RIGS = {
    "as it is": lambda camera: camera,
    "principal point": lambda camera: replace(camera, K=camera.K * [[1, 1, 10], [1, 1, 1], [1, 1, 1]]),
    "y up": lambda camera: replace(camera, R=camera.R @ TO_Y_UP),
}


@pytest.mark.parametrize(
    ("rig", "pixels", "part"),
    [
        ("as it is", lambda p: p / [1280, 960], "camera 'cam0': the keypoints lie between"),
        ("as it is", lambda p: 2.0 * p, "beyond its picture of 1280 x 960 pixels: the calibration is of another"),
        ("principal point", lambda p: p, "the principal point (6395, 479.5) lies outside its picture of 1280 x 960"),
        ("y up", lambda p: p, "where the y axis of the world points up; expected z. If this is so, give --up=y"),
        ("camera 1 as the world", lambda p: p, "where the -y axis of the world points up"),
        ("as it is", without_camera_3, "nobody is detected in any frame of the camera cam3"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, rig, pixels, part):
    cameras, _, seen = filmed(frames=3)
    if rig == "camera 1 as the world":
        first = cameras[0]
        turned = [replace(each, R=each.R @ first.R.T, t=each.t - each.R @ first.R.T @ first.t) for each in cameras]
        cameras = Rig(turned)
    else:
        cameras = Rig([RIGS[rig](camera) for camera in cameras])
    pose2sim.write_calibration(tmp_path / "Calib.toml", cameras)
    write_openpose(tmp_path / "openpose", NAMES, pixels(seen))
    call = ["estimate", tmp_path / "Calib.toml", tmp_path / "openpose", "--out", tmp_path / "out"]
    result = CliRunner().invoke(app, [str(each) for each in call])
    lines = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert result.exit_code == 2, result.output
    assert len(lines) == 1
    assert part in lines[0]
    assert not (tmp_path / "out").exists()
