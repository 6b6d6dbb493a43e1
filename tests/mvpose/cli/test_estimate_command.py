"""``mvpose estimate``: from files to files, and one line for everything that is wrong."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from lab_files import filmed, write_openpose, write_pose2sim
from typer.testing import CliRunner

from mvpose import COCO17, Rig
from mvpose.cli.app import app
from mvpose.formats.calibration import pose2sim, voxelpose

NAMES = ["cam0", "cam1", "cam2", "cam3"]


def run(*arguments):
    return CliRunner().invoke(app, [str(each) for each in arguments])


def ends(result, code, *parts):
    """One line of error with some texts, and the exit code."""
    lines = [line for line in result.stderr.splitlines() if not line.startswith("note: ")]
    assert result.exit_code == code, result.output
    assert len(lines) == 1, result.stderr
    for part in parts:
        assert part in lines[0]
    assert "Traceback" not in result.output


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder with the files of two people in 12 frames, and their joints."""
    folder = tmp_path_factory.mktemp("lab")
    rig, joints, pixels = filmed()
    pose2sim.write_calibration(folder / "Calib.toml", rig)
    voxelpose.write_calibration(folder / "unsized.json", rig)
    write_openpose(folder / "openpose", NAMES, pixels)
    write_pose2sim(folder / "project", NAMES, pixels)
    return folder, rig, joints, pixels


def distances(table, joints):
    """Distance of each row of a table from the nearest of two people at its time, metres."""
    rows = [COCO17.index(joint) for joint in table["joint"]]
    truth = joints[table["frame"].to_numpy(), :, rows]
    return np.linalg.norm(truth - table["x", "y", "z"].to_numpy()[:, None], axis=-1).min(axis=1)


class TestEstimate:
    @pytest.mark.slow
    @pytest.mark.parametrize("given", ["openpose", "project"])
    def test_people_are_where_they_were(self, lab, tmp_path, given):
        folder, _, joints, _ = lab
        page = [] if given == "project" else ["--no-page"]
        result = run("estimate", folder / "Calib.toml", folder / given, "--out", tmp_path / "out", "--fps", 25, *page)
        assert result.exit_code == 0, result.output
        assert "2 people in 12 frames" in result.stdout
        table = pl.read_parquet(tmp_path / "out" / "poses.parquet")
        assert table["person"].n_unique() == 2
        assert len(table) == 12 * 2 * 17
        assert np.median(distances(table, joints)) < 0.01
        files = [".written", "inputs.json", "people.json", "person_0.trc", "person_1.trc", "poses.parquet"]
        files += [] if page else ["recording.html", "recording.json"]
        assert sorted(each.name for each in (tmp_path / "out").iterdir()) == files
        about = json.loads((tmp_path / "out" / "inputs.json").read_text())
        assert about["numbers"] == list(range(12))

    def test_formats_frames_methods_and_times(self, lab, tmp_path):
        folder = lab[0]
        (tmp_path / "times.csv").write_text("t\n" + "".join(f"{5 + k / 30}\n" for k in range(2, 10)))
        result = run(
            "estimate", folder / "Calib.toml", folder / "openpose", "--out", tmp_path / "out", "--format", "csv",
            "--no-page", "--frames", "2:9", "--method", "track-fast", "--times", tmp_path / "times.csv",
        )  # fmt: skip
        assert result.exit_code == 0, result.output
        table = pl.read_csv(tmp_path / "out" / "poses.csv")
        np.testing.assert_allclose(table["time"].unique().sort(), 5 + np.arange(2, 10) / 30, atol=1e-6)
        assert not list((tmp_path / "out").glob("*.trc"))

    @pytest.mark.slow
    def test_a_second_run_replaces_the_first_and_other_folders_are_left_alone(self, lab, tmp_path):
        folder = lab[0]
        call = [
            "estimate",
            folder / "Calib.toml",
            folder / "openpose",
            "--method",
            "fast",
            "--frames",
            "0:3",
            "--no-page",
            "--out",
        ]
        assert run(*call, tmp_path / "out").exit_code == 0
        (tmp_path / "out" / "ik.mot").write_text("of OpenSim")
        (tmp_path / "out" / "people.json").write_text("changed by hand")
        again = run(*call, tmp_path / "out")
        assert again.exit_code == 0
        assert f"note: {tmp_path / 'out'}: ik.mot, people.json not of the earlier result" in again.stderr
        assert (tmp_path / "out" / "ik.mot").read_text() == "of OpenSim"
        assert (tmp_path / "out" / "kept" / "people.json").read_text() == "changed by hand"
        assert json.loads((tmp_path / "out" / "people.json").read_text())["frames"]
        (tmp_path / "thesis").mkdir()
        (tmp_path / "thesis" / "chapter.txt").write_text("years of work")
        ends(run(*call, tmp_path / "thesis"), 2, "is no result of mvpose estimate")

    @pytest.mark.slow
    def test_sizes_that_no_file_states_are_named(self, lab, tmp_path):
        folder = lab[0]
        result = run("estimate", folder / "unsized.json", folder / "openpose", "--no-page", "--out", tmp_path / "out")
        assert result.exit_code == 0, result.output
        assert "taken as 1280 x 960" in result.stderr
        assert json.loads((tmp_path / "out" / "inputs.json").read_text())["cameras"][0]["size"] == [1280, 960]


class TestRefusals:
    def refused(self, lab, tmp_path, *parts, calibration="Calib.toml", detections=("openpose",), options=(), code=2):
        folder = lab[0]
        paths = [folder / each for each in detections]
        result = run("estimate", folder / calibration, *paths, "--out", tmp_path / "out", *options)
        ends(result, code, *parts)
        assert not (tmp_path / "out").exists()

    @pytest.mark.parametrize(
        ("options", "part"),
        [
            (["--method", "trak"], "expected one of full"),
            (["--method", "appearance"], "needs descriptors"),
            (["--format", "docx"], "unknown format 'docx'"),
            (["--lag", "-1"], "--lag must be 0 s or more"),
            (["--fps", "0"], "--fps must be above 0"),
            (["--fps", "25", "--times", "x"], "give one of them"),
            (["--times", "x"], "x: no such file"),
            (["--frames", "7"], "--frames must be FIRST:LAST"),
            (["--size", "big"], "--size must be WIDTHxHEIGHT"),
            (["--cameras", "cam0,camX"], "--cameras: the rig has no camera 'camX'; did you mean 'cam"),
            (["--skeleton", "coc17"], "no skeleton 'coc17' is known; did you mean coco17"),
            (["--up", "w"], "--up must be one of"),
        ],
    )
    def test_options(self, lab, tmp_path, options, part):
        self.refused(lab, tmp_path, part, options=options)

    def test_times_of_another_number_of_frames(self, lab, tmp_path):
        (tmp_path / "times.txt").write_text("0\n1\n")
        self.refused(lab, tmp_path, "expected 12 lines", "got 2 lines", options=["--times", tmp_path / "times.txt"])

    def test_exchanged_cameras(self, lab, tmp_path):
        """Detections of two cameras of four, the one for the other: what remains still gives people."""
        order = ("openpose/cam1", "openpose/cam0", "openpose/cam2", "openpose/cam3")
        for name, each in zip(NAMES, order, strict=True):
            (tmp_path / "mixed").mkdir(exist_ok=True)
            (tmp_path / "mixed" / name).symlink_to(lab[0] / each)
        result = run("estimate", lab[0] / "Calib.toml", tmp_path / "mixed", "--out", tmp_path / "out", "--no-page")
        contradicted = "contradicts the detections" in result.stderr
        assert contradicted or "which therefore adds nothing" in result.stderr

    @pytest.mark.parametrize("wrong", ["camera to world", "in feet", "focal length"])
    def test_wrong_calibrations(self, lab, tmp_path, wrong):
        folder, rig, _, _ = lab

        def changed(camera):
            if wrong == "camera to world":
                return replace(camera, R=camera.R.T, t=-camera.R.T @ camera.t)
            if wrong == "in feet":
                return replace(camera, t=camera.t / 0.3048)
            return replace(camera, K=camera.K * [[1.4, 1, 1], [1, 1.4, 1], [1, 1, 1]])

        pose2sim.write_calibration(tmp_path / "wrong.toml", Rig([changed(camera) for camera in rig]))
        options = ["--up=z"] if wrong == "camera to world" else []
        result = run("estimate", tmp_path / "wrong.toml", folder / "openpose", "--out", tmp_path / "out", *options)
        if not (result.exit_code == 0 and "0 people" in result.stdout):
            ends(result, 2, "mvpose doctor")
            assert not (tmp_path / "out").exists()

    @pytest.mark.slow
    def test_trust_writes_and_says_so(self, lab, tmp_path):
        folder, rig, _, _ = lab
        wide = [replace(camera, K=camera.K * [[1.4, 1, 1], [1, 1.4, 1], [1, 1, 1]]) for camera in rig]
        pose2sim.write_calibration(tmp_path / "wrong.toml", Rig(wide))
        call = [
            "estimate",
            tmp_path / "wrong.toml",
            folder / "openpose",
            "--out",
            tmp_path / "out",
            "--trust",
            "--no-page",
        ]
        result = run(*call)
        assert result.exit_code == 0
        assert "contradicts the detections" in result.stderr
        assert (tmp_path / "out" / "poses.parquet").exists()


class TestFailures:
    def test_an_output_that_cannot_be_written_is_found_before_anything_is_read(self, lab, tmp_path):
        (tmp_path / "file").write_text("")
        for place, part in ((tmp_path / "file", "is a file"), (Path("/proc/none/out"), "cannot be written")):
            ends(run("estimate", "no calibration", lab[0] / "openpose", "--out", place), 2, part)

    def test_a_full_disk_leaves_nothing(self, lab, tmp_path, monkeypatch):
        def full(*_):
            raise OSError(28, "No space left on device", "poses.parquet")

        monkeypatch.setattr("mvpose.files.atomic_files.Path.write_bytes", full, raising=False)
        result = run("estimate", lab[0] / "Calib.toml", lab[0] / "openpose", "--out", tmp_path / "out")
        ends(result, 3, "No space left on device", "nothing was written")
        assert list(tmp_path.iterdir()) == []

    def test_an_estimator_that_raises_gives_one_line(self, lab, tmp_path, monkeypatch):
        def broken(*_, **__):
            raise ZeroDivisionError("half way")

        monkeypatch.setattr("mvpose.tracking.tracker.Tracker.advance", broken)
        result = run("estimate", lab[0] / "Calib.toml", lab[0] / "openpose", "--out", tmp_path / "out")
        ends(result, 3, "estimation: ZeroDivisionError: half way")
        assert list(tmp_path.iterdir()) == []


class TestProgram:
    def test_help_needs_no_numerical_package(self):
        heavy = "{'numpy', 'numba', 'cv2', 'polars'}"
        program = f"import sys; from mvpose.cli.app import app; print(sorted(set(sys.modules) & {heavy}))"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"

    def test_the_commands_are_listed(self):
        result = run("--help")
        assert result.exit_code == 0
        assert "estimate" in result.stdout

    def test_without_typer_the_program_says_what_to_install(self, tmp_path):
        (tmp_path / "typer.py").write_text("raise ModuleNotFoundError(\"No module named 'typer'\", name='typer')")
        place = os.pathsep.join([str(tmp_path), *sys.path])
        done = subprocess.run(
            [sys.executable, "-m", "mvpose.cli"],
            check=False,
            env={**os.environ, "PYTHONPATH": place},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 1
        assert done.stderr == "error: mvpose needs typer, which is not installed; pip install 'mvpose[recordings]'\n"
