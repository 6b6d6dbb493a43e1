"""Projects: trials of a file or of Pose2Sim, estimated once, each for itself, and the table about them."""

import dataclasses
import json
import os
import shutil

import pytest
from lab_files import filmed, write_openpose
from typer.testing import CliRunner

from mvpose.cli import estimate_command
from mvpose.cli.app import app
from mvpose.cli.batch_command import TRIAL
from mvpose.cli.estimate_command import Wanted
from mvpose.cli.inputs import Choices
from mvpose.cli.project_file import LabProject
from mvpose.commands.option_groups import flag
from mvpose.formats.calibration import pose2sim

HEAD = 'calibration = "Calib.toml"\nmethod = "fast"\npage = false\ndoctor = false\nfps = 25\n'


@pytest.fixture
def lab(tmp_path):
    """A calibration, and two trials in which people walk."""
    rig, _, pixels = filmed(frames=6)
    pose2sim.write_calibration(tmp_path / "Calib.toml", rig)
    for trial in ("day/one", "day/two"):
        write_openpose(tmp_path / trial / "pose", [camera.name for camera in rig], pixels)
    return tmp_path


def batch(lab, *words):
    return CliRunner().invoke(app, ["batch", str(lab), *words])


def project(lab, text):
    (lab / "project.toml").write_text(text)
    return lab


def rows_of(result):
    """The lines of the table by the name of the trial."""
    lines = [line.split() for line in result.stdout.splitlines() if line.startswith(" day/")]
    return {words[0]: words for words in lines if words[0].startswith("day/")}


FOLDERS = HEAD + 'folders = ["day/*"]\ndetections = "{trial}/pose"\n'


def test_every_trial_has_a_folder_and_a_row(lab, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    result = batch(project(lab, FOLDERS + 'format = ["csv", "trc"]\n'))
    assert result.exit_code == 0, result.stderr
    assert {name: words[1:3] for name, words in rows_of(result).items()} == {
        "day/one": ["6", "2"],
        "day/two": ["6", "2"],
    }
    for name in ("one", "two"):
        assert (lab / "results" / "day" / name / "poses.csv").is_file()


@pytest.mark.slow
def test_a_finished_trial_is_not_done_again_unless_its_inputs_changed(lab, monkeypatch):
    done = []
    real = estimate_command.estimate_into
    monkeypatch.setattr(
        estimate_command, "estimate_into", lambda *words, **more: (done.append(words[0]), real(*words, **more))
    )
    project(lab, FOLDERS)

    def again():
        done.clear()
        assert batch(lab).exit_code == 0
        return len(done)

    assert [again(), again()] == [2, 0]
    file = next((lab / "day" / "one" / "pose" / "cam1").iterdir())
    os.utime(file, ns=(1, 1))
    assert again() == 1
    project(lab, FOLDERS + '[trials."day/two"]\nfps = 50\n')
    assert again() == 1
    (lab / "results" / "day" / "one" / "people.json").unlink()
    assert again() == 1
    (lab / "results" / "day" / "two" / TRIAL).write_text("{")
    assert again() == 1
    moved = lab.with_name("moved")
    shutil.copytree(lab, moved)  # keeps the times of files
    assert (done.clear(), batch(moved).exit_code, done) == (None, 0, [])


def test_a_trial_that_was_interrupted_is_not_finished(lab, monkeypatch):
    project(lab, FOLDERS)
    real = estimate_command.estimate_into

    def killed(*words, **more):
        real(*words, **more)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(estimate_command, "estimate_into", killed)
        assert batch(lab).exit_code == 130
    assert not (lab / "results" / "day" / "one" / TRIAL).exists()
    assert "finished by an earlier run" not in batch(lab).stderr


def test_an_error_of_one_trial_leaves_the_others_and_is_in_the_exit_code(lab):
    (lab / "day" / "one" / "pose" / "cam1" / "cam1_000000000002_keypoints.json").write_text('{"people": [')
    result = batch(project(lab, FOLDERS))
    assert result.exit_code == 3
    assert (lab / "results" / "day" / "two" / TRIAL).is_file()
    assert not (lab / "results" / "day" / "one").exists()
    assert "day/one: failed: " in result.stdout
    assert "broken or truncated JSON" in result.stdout


@pytest.mark.parametrize(("error", "traced"), [(TypeError("of the code"), True), (ValueError("of the input"), False)])
def test_an_internal_error_has_its_traceback_and_leaves_the_others(lab, monkeypatch, error, traced):
    real = estimate_command.estimate_into

    def fail(calibration, detections, *words):
        if "one" in str(detections):
            raise error
        real(calibration, detections, *words)

    monkeypatch.setattr(estimate_command, "estimate_into", fail)
    project(lab, FOLDERS)
    result = batch(lab)
    assert result.exit_code == 3
    assert str(error) in result.stderr
    assert ("Traceback" in result.stderr) == traced
    assert (lab / "results" / "day" / "two" / TRIAL).is_file()


def test_warnings_of_a_trial_are_below_the_table_also_when_it_is_finished(lab):
    project(lab, FOLDERS.replace("fps = 25\n", ""))
    for result in (batch(lab), batch(lab)):
        assert "day/one, day/two: no --fps: 25 frames per second are assumed" in result.stdout
    kept = json.loads((lab / "results" / "day" / "one" / TRIAL).read_text())["warnings"]
    assert not any(text.startswith("detections of cameras, by name") for text in kept)


def test_a_folder_of_the_user_is_not_replaced(lab):
    (lab / "mine" / "day" / "one").mkdir(parents=True)
    (lab / "mine" / "day" / "one" / "thesis.txt").write_text("years of work")
    result = batch(project(lab, FOLDERS), "--out", str(lab / "mine"))
    assert result.exit_code == 3
    assert (lab / "mine" / "day" / "one" / "thesis.txt").read_text() == "years of work"
    assert "has files" in result.stderr


def test_keys_are_the_options_of_estimate(lab):
    wanted = {flag(each)[2:] for kind in (Choices, Wanted) for each in dataclasses.fields(kind)} - {"out"}
    assert {"max-error", "format", "page", "films", "unit", "fps"} <= wanted
    text = {"fps": "2", "max-error": "inf", "lag": "1", "page": "false", "films": "false", "min-frames": "3"}
    lines = [f"{key} = {text[key]}" for key in text] + ['times = "t.csv"', 'pictures = ["a", "b"]', 'size = "4x3"']
    project(
        lab, 'calibration = "Calib.toml"\ndetections = "day/one"\n' + "\n".join(lines) + "\n[trials.a]\nunit = 'mm'"
    )
    choices, results, _ = LabProject.read(lab).trials[0].options(lab / "out")
    assert (choices.fps, choices.unit, choices.size, choices.times) == (2.0, "mm", "4x3", lab / "t.csv")
    assert (results.max_error, results.page, results.films, results.min_frames) == (float("inf"), False, False, 3)
    assert results.pictures == [lab / "a", lab / "b"]
    assert results.out == lab / "out"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fbs = 60\n[trials.a]\n", "unknown key 'fbs' in the project; did you mean 'fps'?"),
        ("zzz = 60\n[trials.a]\n", "unknown key 'zzz' in the project. Keys are the options"),
        ('[trials.a]\nfps = "fast"\n', r"[trials.a]: fps must be a number, got \"fast\""),
        ("[trials.a]\npage = 1\n", "[trials.a]: page must be true or false, got 1"),
        ("trials = 3\n", "trials must be tables"),
        ('calibration = "Calib.toml"\n', "no trials"),
        ('folders = ["night/*"]\n', "no folder 'night/*'"),
        ('detections = "day"\n[trials.a]\n', "[trials.a]: expected calibration"),
        ('calibration = "Calib.toml"\n[trials.a]\n', "[trials.a]: expected detections or videos"),
        ('calibration = "c"\n[trials.a]\nvideos = "v"\ntimes = "t"\n', "[trials.a] times has no effect on videos"),
        ('calibration = "c"\ndetections = "d"\n[trials."../a"]\n', "a name of a trial is that of a folder"),
        ("fps = = 3", "project.toml: "),
    ],
)
def test_a_wrong_project_is_refused_before_anything_runs(lab, text, said):
    result = batch(project(lab, text))
    assert result.exit_code == 2
    assert said.replace('\\"', '"') in " ".join(result.stderr.split())
    assert not (lab / "results").exists()


class TestPose2Sim:
    @pytest.fixture
    def session(self, lab):
        """A session with two trials, whose settings go before its own."""
        settings = "[project]\nframe_rate = 50\n[filtering]\ntype = 'butterworth'\nmake_c3d = true\n"
        (lab / "Config.toml").write_text(settings + "[filtering.butterworth]\ncut_off_frequency = 8\n")
        (lab / "calibration").mkdir()
        (lab / "Calib.toml").rename(lab / "calibration" / "Calib.toml")
        (lab / "day" / "one" / "Config.toml").write_text("[filtering]\ntype = 'gcv_spline'\n")
        (lab / "day" / "two" / "Config.toml").write_text("[filtering]\ntype = 'kalman'\n")
        return lab

    def test_trials_and_options_are_those_of_the_settings(self, session):
        one, two = LabProject.read(session / "Config.toml").trials
        assert (one.name, two.name) == ("day/one", "day/two")
        assert one.calibration == session
        assert one.paths("detections") == [session / "day" / "one" / "pose"]
        assert [each.keys.get("filter") for each in (one, two)] == ["spline", None]
        (session / "day" / "one" / "Config.toml").write_text("")
        assert LabProject.read(session).trials[0].keys["filter"] == "butterworth:8"
        assert one.options(session)[1].formats == "trc,c3d"

    def test_excluded_trials_are_left_out(self, session):
        text = (session / "Config.toml").read_text()
        (session / "Config.toml").write_text(text.replace("50", "50\nexclude_from_batch = ['day/two']"))
        assert [each.name for each in LabProject.read(session).trials] == ["day/one"]

    def test_a_folder_without_settings_is_no_project(self, tmp_path):
        assert batch(tmp_path).exit_code == 2

    def test_videos_are_taken_where_there_are_no_detections(self, session):
        shutil.rmtree(session / "day" / "one" / "pose")
        (session / "day" / "one" / "videos").mkdir()
        (session / "day" / "one" / "videos" / "cam0.mp4").write_bytes(b"")
        one = LabProject.read(session).trials[0]
        assert one.paths("videos") == [session / "day" / "one" / "videos"]
        assert one.keys["fps"] == 50.0
