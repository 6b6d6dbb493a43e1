"""Command line: output, messages and exit codes."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from mvpose.commands.errors import RunError
from simharness.cli import app
from simharness.reality.recording_file import read_recording
from simharness.scenario.presets import read_profile

QUICKSTART = str(Path(__file__).parents[2] / "scenarios" / "quickstart.toml")
TINY = [
    *("--set", "people.count=2", "--set", "cameras.count=3", "--set", "duration=0.3"),
    *("--set", "cameras.size=[160, 120]", "--set", "clutter.boxes=1", "--set", "clutter.shelves=0"),
]
OUTSIDE = ("--set", "room.walls=false")  # the light of a room takes most of the time of a picture


@pytest.fixture
def simharness(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str):
        return CliRunner().invoke(app, list(arguments), catch_exceptions=False)

    return call


def assert_refused(result, *messages: str):
    """Assert that there is one message and no traceback."""
    assert result.exit_code == 2
    assert result.stderr.startswith("error: ")
    assert "Traceback" not in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    for text in messages:
        assert text in result.stderr
    assert result.stdout == ""


def test_version(simharness):
    result = simharness("--version")
    assert result.exit_code == 0
    assert result.stdout.startswith("simharness 0.")


EVALUATIONS = ("evaluate shelf", "evaluate recording", "evaluate poses")
COMMANDS = ("", "run", "render", "evaluate", *EVALUATIONS, "fit-detector shelf")


@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_printed(simharness, command):
    result = simharness(*command.split(), "--help")
    assert result.exit_code == 0
    assert "Usage" in result.stdout


class TestBadInput:
    def test_unknown_key(self, simharness, tmp_path):
        path = tmp_path / "room.toml"
        path.write_text('name = "room"\n[people]\ncuont = 2\n')
        assert_refused(simharness("run", str(path)), str(path), "people.cuont", "did you mean people.count?")

    def test_brackets_in_messages_are_shown(self, simharness):
        assert_refused(simharness("run", QUICKSTART, "--set", "people=3"), "a section [people] with keys")

    def test_missing_file(self, simharness):
        assert_refused(simharness("run", "nothing.toml"), "nothing.toml: no such file")

    def test_one_camera(self, simharness):
        assert_refused(simharness("run", QUICKSTART, "--set", "cameras.count=1"), "cameras.count = 1", "at least 2")

    def test_no_camera(self, simharness):
        assert_refused(simharness("run", QUICKSTART, "--set", "cameras.count=0"), "cameras.count = 0", "at least 2")

    def test_camera_in_a_wall(self, simharness):
        result = simharness("run", QUICKSTART, *TINY, "--set", "cameras.radius=4.5")
        assert_refused(result, "camera 'cam", "wall", "cameras.radius")

    @pytest.mark.slow
    def test_people_that_do_not_fit(self, simharness):
        result = simharness("run", QUICKSTART, "--set", "people.count=12", "--set", "people.area=0.5")
        assert_refused(result, "people.")

    def test_unknown_variant(self, simharness):
        result = simharness("run", QUICKSTART, *TINY, "--set", 'method.variants=["best"]')
        assert_refused(result, "method.variants", "'best'", "full")

    def test_a_variant_that_needs_missing_descriptors(self, simharness):
        assert_refused(
            simharness("run", QUICKSTART, *TINY, "--set", 'method.variants=["appearance"]'), "appearance", "descriptors"
        )
        assert_refused(
            simharness("evaluate", "shelf", "nowhere", "--method", "appearance"), "appearance", "descriptors"
        )

    def test_out_that_cannot_be_a_folder(self, simharness, tmp_path):
        (tmp_path / "file").touch()
        assert_refused(simharness("run", QUICKSTART, *TINY, "--out", "file/deep"), "--out", "file")

    def test_missing_data(self, simharness):
        assert_refused(simharness("evaluate", "shelf", "nowhere"), "nowhere: no such folder")

    def test_unknown_recording(self, simharness):
        assert_refused(simharness("evaluate", "shelv"), "shelv: no such recording; did you mean shelf?")
        assert_refused(simharness("evaluate", "--head", "2019", "shelf"), "shelf: give FOLDER")

    def test_unknown_method(self, simharness):
        assert_refused(simharness("evaluate", "shelf", "nowhere", "--method", "best"), "'best'", "full")

    def test_a_missing_user_defined_estimator(self, simharness):
        refused = simharness("evaluate", "shelf", "nowhere", "--method", "nobody.py:Mine")
        assert_refused(refused, "nobody.py", "no such file")

    @pytest.mark.slow
    def test_a_user_defined_estimator_is_scored(self, simharness, tmp_path, shared_data):
        """The estimator is a preset, so its scores are those of the preset."""
        file, summary = tmp_path / "custom.py", tmp_path / "shelf.json"
        file.write_text('from mvpose import preset\n\ncustom = preset("fast")\n')
        methods = ["--method", "fast", "--method", f"{file}:custom"]
        assert (
            simharness("evaluate", "shelf", str(shared_data / "shelf"), *methods, "--json", str(summary)).exit_code == 0
        )
        fast, custom = json.loads(summary.read_text())["variants"].values()
        assert custom["pcp"] == fast["pcp"] > 90

    @pytest.mark.slow
    def test_nothing_is_left_behind(self, simharness, tmp_path):
        simharness("run", QUICKSTART, *TINY, "--set", "cameras.radius=4.5")
        assert list(tmp_path.rglob("*.json")) == list(tmp_path.rglob("*.html")) == []


@pytest.mark.slow
@pytest.mark.parametrize("error", [ValueError("wrong turn"), KeyError("lost"), RunError("film: frame 3")])
def test_an_internal_error_shows_its_traceback(simharness, monkeypatch, tmp_path, error):
    def broken(*_args, **_options):
        raise error

    monkeypatch.setattr("simharness.trial.stages.simulation.detect", broken)
    result = simharness("run", QUICKSTART, *TINY, *OUTSIDE)
    assert result.exit_code == 3
    assert "Traceback" in result.stderr
    assert "failed: detect: " in result.stderr
    assert not list(tmp_path.rglob("summary.json"))


@pytest.mark.slow
def test_a_run_prints_the_scores_and_the_path_of_the_report(simharness, tmp_path):
    result = simharness("run", QUICKSTART, *TINY, *OUTSIDE, "--seed", "3")
    assert result.exit_code == 0, result.stderr
    report = Path(result.stdout.strip().splitlines()[-1].removeprefix("report: "))
    assert (tmp_path / report).read_text(encoding="utf-8").startswith("<!doctype html>")
    summary = json.loads((tmp_path / report).with_name("summary.json").read_text())
    assert summary["seed"] == 3
    assert summary["frames"] == 3
    for variant in ("full", "no-3dps"):
        assert variant in summary["variants"]
        assert variant in result.stdout


def test_a_detector_is_fitted_to_data_that_are_there(simharness, tmp_path):
    assert_refused(simharness("fit-detector", "shelf", str(tmp_path / "none")), "none: no such folder")


@pytest.mark.slow
def test_fitting_prints_the_table_and_writes_a_profile_that_loads(simharness, tmp_path, shared_data, monkeypatch):
    """On the first half of the recording, six seconds: what is fitted is checked elsewhere."""

    def read_part(*arguments):
        return read_recording(*arguments).during(np.arange(150))

    monkeypatch.setattr("simharness.reality.recording_file.read_recording", read_part)
    out = tmp_path / "fitted.toml"
    result = simharness("fit-detector", "shelf", str(shared_data / "shelf"), "--out", str(out))
    assert result.exit_code == 0
    assert "Classes of errors" in result.stdout
    assert read_profile(str(out)).keypoints.scatter.wrists > 0
