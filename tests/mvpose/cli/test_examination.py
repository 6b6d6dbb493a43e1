"""The doctor's verdict in ``mvpose estimate``: on the terminal, on the page, and never in the way."""

import json

import numpy as np
import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose import Detections
from mvpose.calibration.findings import Diagnosis, Finding
from mvpose.cli import estimation
from mvpose.cli.app import app
from mvpose.cli.estimation import examined_frames
from mvpose.formats.calibration import pose2sim


def frames_of(counts):
    def frame(n):
        return Detections.from_keypoints(np.zeros(n, int), np.ones((n, 17, 2)), np.ones((n, 17)))

    made = {n: frame(n) for n in set(counts)}
    return [made[n] for n in counts]


class TestFrames:
    def test_all_of_a_short_recording(self):
        rows, step = examined_frames(frames_of([1] * 30), period=0.04)
        assert (rows.tolist(), step) == (list(range(30)), 1)

    def test_as_far_apart_as_people_can_be_followed(self):
        """Three seconds at 100 Hz in steps of 30 ms; an hour at 25 Hz in steps of .12 s."""
        rows, step = examined_frames(frames_of([1] * 300), period=0.01)
        assert (rows.tolist(), step) == (list(range(0, 300, 3)), 3)
        rows, step = examined_frames(frames_of([1] * 90_000), period=0.04)
        assert (len(rows), step) == (100, 3)
        assert np.diff(rows).tolist() == [3] * 99

    def test_slow_recordings_keep_every_frame(self):
        assert examined_frames(frames_of([1] * 1000), period=0.5)[1] == 1

    def test_where_most_is_detected(self):
        rows, step = examined_frames(frames_of([1] * 400 + [5] * 300 + [0] * 500), period=0.04)
        assert step == 3
        assert rows[0] + 3 >= 400
        assert rows[-1] < 703


@pytest.fixture
def lab(tmp_path):
    rig, _, pixels = filmed(frames=4)
    pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
    write_openpose(tmp_path / "openpose", [camera.name for camera in rig], pixels)
    return tmp_path


def estimate(lab, *options):
    words = ["estimate", lab / "Calib.toml", lab / "openpose", "--out", lab / "out", "--fps", 25, "--method", "fast"]
    return CliRunner().invoke(app, list(map(str, [*words, *options])))


def verdicts(result):
    assert result.exit_code == 0, result.output
    return [line for line in result.stderr.splitlines() if "calibration" in line]


class TestCommand:
    @pytest.mark.slow
    def test_a_short_recording_tells_nothing(self, lab):
        (line,) = verdicts(estimate(lab))
        assert line.startswith(
            "note: calibration, by 4 of 4 frames: This recording does not determine whether the cameras are right: "
        )
        page, numbers = (lab / "out" / f"recording.{kind}" for kind in ("html", "json"))
        assert "cannot tell" in page.read_text(encoding="utf-8")
        assert json.loads(numbers.read_text())["doctor"]["verdict"] == "cannot tell"

    def test_faults_are_named_with_what_to_do(self, lab, monkeypatch):
        fault = Finding("moved-camera", "cam2 moved by 4 degrees", "alarm", 0.99, view=2, camera="cam2", mend="turn it")
        found = Diagnosis.of_findings(
            [fault], evidence=[], cameras=("cam0", "cam1", "cam2", "cam3"), residuals=np.ones(4)
        )
        monkeypatch.setattr("mvpose.calibration.diagnose", lambda *_, **__: found)
        (line,) = verdicts(estimate(lab, "--no-page"))
        assert line.endswith("frames: Camera cam2 moved by 4 degrees. `mvpose doctor` says what mends it")

    @pytest.mark.slow
    def test_a_failure_of_the_doctor_is_none_of_the_estimation(self, lab, monkeypatch):
        def broken(*_, **__):
            raise ZeroDivisionError("half way")

        monkeypatch.setattr("mvpose.calibration.diagnose", broken)
        (line,) = verdicts(estimate(lab))
        assert "the calibration was not examined (ZeroDivisionError: half way)" in line
        assert (lab / "out" / "recording.html").exists()

    @pytest.mark.slow
    def test_it_may_be_left_out(self, lab, monkeypatch):
        monkeypatch.setattr(estimation, "examine", None)
        assert verdicts(estimate(lab, "--no-doctor")) == []
