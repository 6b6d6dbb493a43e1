"""Kept failures: read back as they were written, replayed to the bit, described by what is left of them."""

import re

import numpy as np
import pytest
from crowded_frames import crowd
from typer.testing import CliRunner

from simharness.cli import app
from simharness.hunt.frozen_frame import DrawnError, freeze
from simharness.hunt.kept_failure import first_violation, judge_of, keep, read_failure, write_failure
from simharness.scenario.toml_files import ScenarioError

WANTED = ("merged", "swapped_limb", "missed", "ghost")


@pytest.fixture(scope="module")
def kept():
    judge = judge_of("full")
    _, frame, violation = first_violation(crowd(), judge, WANTED)
    return keep(frame, violation, judge, scenario="crowd", about={"variant": "full", "origin": "crowd, frame 0"})


def test_a_failure_is_read_as_it_was_written_and_replayed_to_the_bit(kept, tmp_path):
    path = write_failure(kept, tmp_path)
    again = read_failure(path)
    assert again == kept
    assert write_failure(again, tmp_path / "again").read_bytes() == path.read_bytes()
    (before, failed), (after, fails) = kept.replay(), again.replay()
    assert failed
    assert fails
    np.testing.assert_array_equal(before, after)
    assert max(map(len, path.read_text().split("[[cameras]]")[1].splitlines())) <= 120


def test_a_failure_without_people_is_read(kept, tmp_path):
    alone = kept.model_copy(update=vars(kept.of(people=())))
    assert read_failure(write_failure(alone, tmp_path)) == alone


def test_the_words_name_every_error(kept):
    assert kept.text.count(";") == max(len(kept.errors) - 1, 0)
    for error in kept.errors:
        assert error.camera in kept.text
        assert error.joint.replace("_", " ") in kept.text
    assert kept.stage == "detection"
    assert 0 <= kept.noise_failed <= kept.noise_seeds


def test_a_keypoint_on_another_person_is_described(kept):
    from simharness.hunt.kept_failure import error_text

    recording = crowd()
    frame = freeze(recording.rig, recording.detections[4], recording.truth[4]).with_errors(())
    _, place = frame.places()
    away = place[0, 1, 7] - place[0, 0, 7] + [3.0, 4.0]
    error = DrawnError(
        kind="keypoint", camera=frame.cameras[0].name, person=0, joint="left_elbow", offset=tuple(away), score=1.0
    )
    size = np.hypot(*away)
    text = error_text(frame.with_errors([error]), error)
    assert f"lies on person 1's, 5 px apart, and {size:.0f} px from its own place" in text


@pytest.mark.parametrize(
    ("before", "after", "what"),
    [
        ('violated = "', 'broken = "', "violated"),
        ("kind = ", "sort = ", "kind"),
        ("size = [800, 600]", "size = [800]", "size"),
        ('camera = "', 'camera = "no', "no"),
    ],
)
def test_a_damaged_file(kept, tmp_path, before, after, what):
    path = write_failure(kept, tmp_path)
    path.write_text(path.read_text().replace(before, after, 1))
    with pytest.raises(ScenarioError, match=what):
        read_failure(path)


SMALL = ["--set", "people.count=4", "--set", "duration=0.6", "--set", "detector.profile=crowded"]
SMALL += ["--set", "rendering.renderer=rays", "--set", "people.spacing=0.5", "--set", "people.area=1.5"]


def call(*arguments):
    return CliRunner().invoke(app, ["shrink", *map(str, arguments)])


@pytest.mark.slow
def test_the_command_shrinks_and_replays(tmp_path):
    made = call("quickstart", *SMALL, "--seed", 1, "--out", tmp_path)
    assert made.exit_code == 0, made.output
    (path,) = tmp_path.glob("*.toml")
    assert "Without" in made.stdout.replace("\n", " ")
    assert re.search(r"fails again with \d+ of 20", made.stdout.replace("\n", " "))
    replayed = call(path)
    assert replayed.exit_code == 1
    assert "still fails" in replayed.stdout
    text = path.read_text()
    path.write_text(text[: text.index("\n[[errors]]")])
    mended = call(path)
    assert mended.exit_code == 0, mended.output
    assert "does not fail any more" in mended.stdout


@pytest.mark.slow
def test_a_run_is_shrunk_as_its_scenario(tmp_path):
    run = CliRunner().invoke(app, ["run", "quickstart", *SMALL, "--seed", "1", "--out", str(tmp_path / "runs")])
    assert run.exit_code == 0, run.output
    (folder,) = (tmp_path / "runs").iterdir()
    first, second = (tmp_path / name for name in ("a", "b"))
    of_run = call(folder, "--out", first)
    assert of_run.exit_code == 0, of_run.output
    assert "another answer" not in of_run.stderr
    assert call("quickstart", *SMALL, "--seed", 1, "--out", second).exit_code == 0
    (one,), (other,) = first.glob("*.toml"), second.glob("*.toml")
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--property", "luck"], "no such property"),
        (["--property", "disagree"], "--rival"),
        (["--rival", "fast"], "--rival"),
        (["--frame", "9"], "--frame 9"),
        (["--variant", "track"], "memory"),
        (["--set", "detector.heatmaps.size=64x48"], "heat maps"),
        (["--property", "renamed"], "nothing fails"),
    ],
)
def test_what_cannot_be_shrunk(options, what, tmp_path):
    result = call("quickstart", *SMALL, "--out", tmp_path, *options)
    assert result.exit_code == 2
    assert what in result.stderr
