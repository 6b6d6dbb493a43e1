"""``mvpose doctor``: what the diagnosis says, as lines and as JSON, and its exit code."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose.calibration import Diagnosis, Finding
from mvpose.cli.app import app
from mvpose.cli.doctor_command import repair_line
from mvpose.cli.inputs import Choices
from mvpose.formats.calibration import pose2sim

NAMES = ["cam0", "cam1", "cam2", "cam3"]
MOVED = Finding(
    "moved-camera", "camera cam2 moved", camera="cam2", view=2, mend="look at it", repair=("--free", "extrinsics")
)


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Return a function that runs the command with a given diagnosis, and the arguments that the doctor got."""
    rig, _, pixels = filmed(frames=3)
    pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
    write_openpose(tmp_path / "openpose", NAMES, pixels)
    got = {}

    def run(findings, *options):
        def diagnose(rig, frames, *, period, up):
            got.update(rig=rig, frames=frames, period=period, up=up)
            seen = {"cameras": NAMES, "residuals": np.full(4, 2.5), "within": {"degrees": 0.44, "metres": 0.051}}
            return Diagnosis.of_findings(findings, evidence=["3 frames"], **seen)

        monkeypatch.setattr("mvpose.calibration.diagnose", diagnose)
        arguments = ["doctor", tmp_path / "Calib.toml", tmp_path / "openpose", *options]
        return CliRunner().invoke(app, [str(each) for each in arguments]), got

    return run


def test_faults_are_named_with_what_mends_them(call, tmp_path):
    folder = tmp_path
    result, got = call([MOVED], "--fps", "50")
    assert result.exit_code == 1
    assert result.stdout.splitlines() == [
        "verdict: faults", "! camera cam2 moved", "    look at it", "what mends it:",
        f"  mvpose repair {folder}/Calib.toml {folder}/openpose --fps 50 --free extrinsics --out mended/Calib.toml",
        "evidence:", "  3 frames",
    ]  # fmt: skip
    assert got["period"] == 0.02
    assert [len(frame) for frame in got["frames"]] == [8, 8, 8]


def test_fine_says_what_it_excludes(call):
    result, _ = call([])
    assert result.stdout.splitlines()[:2] == [
        "verdict: fine", "  Nothing is wrong with the cameras: none is off by more than 0.4 degrees or 5 cm."
    ]  # fmt: skip


def test_json_is_that_of_the_diagnosis(call):
    result, _ = call([], "--json")
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    assert told["verdict"] == "fine"
    assert told["residuals_px"] == dict.fromkeys(NAMES, 2.5)


def test_what_estimate_refuses_the_doctor_examines(call):
    result, got = call([MOVED], "--up", "-z")
    assert result.exit_code == 1
    assert "Traceback" not in result.output
    assert len(got["rig"]) == 4


def test_the_printed_command_repeats_the_options_of_the_user(tmp_path, monkeypatch):
    """Without them it would fail or take another rate; a folder that is there is not written into."""
    monkeypatch.chdir(tmp_path)
    choices = Choices(fps=59.94, size="1280x960", cameras="a b,c", frames="10:300", skeleton="coco17", up="-y")
    line = repair_line(Path("in/Calib.toml"), [Path("my poses"), Path("p2")], choices, ("--mend", "unit:0.001@a b"))
    assert shlex.split(line) == [
        "mvpose", "repair", "in/Calib.toml", "my poses", "p2", "--fps", "59.94", "--size", "1280x960", "--cameras",
        "a b,c", "--frames", "10:300", "--skeleton", "coco17", "--up", "-y", "--mend", "unit:0.001@a b", "--out",
        "mended/Calib.toml",
    ]  # fmt: skip
    Path("mended").mkdir()
    line = repair_line(Path("Calib.toml"), [Path("p")], Choices(), ("--new-times", "TIMES"))
    assert line == "mvpose repair Calib.toml p --new-times mended-2/times.csv"
    assert repair_line(Path("Calib.toml"), [Path("p")], Choices(), ()) == ""


def test_inverted_extrinsics_are_found_whatever_up_says(call):
    """The axis is that of the file's world: the extrinsics are examined as the file has them."""
    _, plain = call([MOVED])
    given = [camera.R for camera in plain["rig"]]
    _, got = call([MOVED], "--up", "-y")
    assert got["up"] == "-y"
    assert all(np.array_equal(camera.R, R) for camera, R in zip(got["rig"], given, strict=True))


def test_a_wrong_axis_is_refused(call):
    result, _ = call([MOVED], "--up", "up")
    assert result.exit_code == 2
    assert "--up must be one of" in result.stderr
