"""``mvpose doctor``: what the diagnosis says, as lines and as JSON, and its exit code."""

import json

import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose.calibration import Diagnosis, Finding
from mvpose.cli.app import app
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
            return Diagnosis.of_findings(findings, evidence=["3 frames"], cameras=NAMES, residuals=np.full(4, 2.5))

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
