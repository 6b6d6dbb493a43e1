"""``--sync``: files of cameras that began at different moments, with different rates, and what is refused."""

import json

import numpy as np
import pytest
from lab_files import scores_of
from moving_people import walk
from people import ring
from typer.testing import CliRunner

from mvpose import Rig
from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim
from mvpose.formats.detections.openpose import people_file
from mvpose.formats.people.people_formats import read_people

RATE = 25.0
STARTS = {"cam0": 40, "cam1": 75, "cam2": 5, "cam3": 52}  # frames of 25 Hz, from which on a camera records
EVERY = {"cam0": 1, "cam1": 1, "cam2": 1, "cam3": 2}  # cam3 has half the rate
LENGTH = 200  # frames of 25 Hz


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """Two people who walk, filmed by four cameras one after the other."""
    folder = tmp_path_factory.mktemp("sync")
    joints = walk(2, frames=280, period=1 / RATE, seed=4)
    rig = Rig([type(c)(c.K, c.R, c.t, c.distortion, c.size, f"cam{k}") for k, c in enumerate(ring(4))])
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    pixels = rig.project(joints).swapaxes(0, 1)
    pixels = pixels + 2.0 * np.random.default_rng(0).standard_normal(pixels.shape)
    for view, (name, start) in enumerate(STARTS.items()):
        (folder / "openpose" / name).mkdir(parents=True)
        for k, people in enumerate(pixels[start : start + LENGTH : EVERY[name], view]):
            content = json.dumps(people_file(people, scores_of(people)))
            (folder / "openpose" / name / f"{name}_{k:012d}_keypoints.json").write_text(content)
    return folder


def call(*words):
    return CliRunner().invoke(app, [str(each) for each in words])


@pytest.fixture(scope="module")
def estimated(lab):
    out = lab / "results"
    options = "--sync", "--rates", "25,25,25,12.5", "--method", "fast", "--no-page", "--no-doctor", "--format", "csv"
    result = call("estimate", lab / "Calib.toml", lab / "openpose", "--out", out, *options)
    assert result.exit_code == 0, result.output
    return result, out


def test_starts_are_recorded_within_a_frame(estimated):
    result, out = estimated
    about = json.loads((out / "inputs.json").read_text())
    starts = [camera["start_s"] for camera in about["cameras"]]
    wanted = (np.array(list(STARTS.values())) - STARTS["cam3"]) / RATE
    np.testing.assert_allclose(starts, wanted, atol=0.5 / RATE)
    assert [camera["fps"] for camera in about["cameras"]] == [25.0, 25.0, 25.0, 12.5]
    assert f"cam1 {starts[1]:+.3f} s" in result.stderr


def test_frames_are_those_of_the_slowest_camera_in_the_time_that_all_share(estimated):
    about = json.loads((estimated[1] / "inputs.json").read_text())
    assert about["fps"] == pytest.approx(12.5)
    first, last = max(STARTS.values()), min(STARTS.values()) + LENGTH - 1  # of 25 Hz
    own = (np.array([first, last]) - STARTS["cam3"]) / EVERY["cam3"]
    assert abs(about["numbers"][0] - own[0]) <= 1
    assert abs(about["numbers"][-1] - own[1]) <= 1


def test_people_are_where_they_were(estimated):
    about = json.loads((estimated[1] / "inputs.json").read_text())
    rows = [STARTS["cam3"] + EVERY["cam3"] * number for number in about["numbers"]]
    true = walk(2, frames=280, period=1 / RATE, seed=4)[rows]
    found = read_people(estimated[1] / "people.json")
    assert found.joints.shape[0] == len(true)
    apart = np.linalg.norm(found.joints[:, :, None] - true[:, None], axis=-1)  # (T, n, 2, J)
    errors = np.nanmin(np.nanmedian(apart, axis=-1), axis=2)
    errors = errors[np.isfinite(errors)]
    assert len(errors) > 1.8 * len(true)
    assert np.median(errors) < 0.03  # a frame of another moment: 0.05 m and more


def test_without_it_the_files_are_refused_and_it_is_named(lab):
    result = call("estimate", lab / "Calib.toml", lab / "openpose", "--out", lab / "none")
    assert result.exit_code == 2
    assert "--sync" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--sync", "--rates", "25,25"), "--rates must be 4 numbers above 0"),
        (("--sync", "--rates", "25,25,25,0"), "--rates must be 4 numbers above 0"),
        (("--rates", "25,25,25,12.5"), "give --sync as well"),
        (("--sync", "--fps", "25", "--rates", "25,25,25,12.5"), "--fps and --rates: give one"),
        (("--sync", "--times", "times.csv"), "--sync and --times: give one"),
        (("--sync", "--rates", "25,25,25,12.5", "--frames", "900:910"), "correct --frames"),
    ],
)
def test_what_cannot_be_is_refused(lab, options, message):
    result = call("doctor", lab / "Calib.toml", lab / "openpose", *options)
    assert result.exit_code == 2
    assert message in result.stderr


def test_times_of_files_that_start_apart_are_not_written(lab):
    words = "repair", lab / "Calib.toml", lab / "openpose", "--sync", "--new-times", lab / "times.csv"
    result = call(*words)
    assert result.exit_code == 2
    assert "--sync and --new-times" in result.stderr
