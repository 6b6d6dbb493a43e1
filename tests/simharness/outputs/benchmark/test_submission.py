"""Scores of people in files on exported sequences: those of a trial, and refused where files do not fit."""

import json
import shutil
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from typer.testing import CliRunner

from mvpose.formats.people import write_people
from mvpose.recording import People
from simharness.cli import app
from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.outputs.benchmark.sequences import export_benchmark
from simharness.outputs.benchmark.submission import read_exact, score_submission
from simharness.scenario.load import load
from simharness.scoring.catalogue import SCORES
from simharness.trial.run_trial import run_trial

SMALL = ("people.count=3", "cameras.count=4", "duration=0.8", "rendering.renderer=rays", "detector.boxes.missed=0.2")
BARE = partial(ExportPlan, pictures=False)
# Scores of matchings and of times, which no file has.
OF_LABELS = (
    "match_",
    "violations",
    "merged",
    "split",
    "phantoms",
    "time_",
)  # of matchings and times, which no file has


@pytest.fixture(scope="module")
def trial():
    """A trial of a tracker, so that people have identities."""
    return run_trial(load("quickstart", overrides=SMALL), variants=["track-fast"], until="score")


@pytest.fixture(scope="module")
def exported(trial, tmp_path_factory):
    return export_sequence(trial.scenario, BARE(tmp_path_factory.mktemp("exported") / "quickstart"))


@pytest.fixture(scope="module")
def people(trial):
    return People.of_estimates(trial.estimates["track-fast"], period=1 / trial.scenario.rate)


def written(people, folder, name="people"):
    folder.mkdir(parents=True, exist_ok=True)
    return write_people(people, folder, formats=["npz"])[0].rename(folder / f"{name}.npz")


def cut(people, frames):
    return replace(
        people,
        times=people.times[:frames],
        joints=people.joints[:frames],
        scores=people.scores[:frames],
        covariance=None,
        numbers=people.numbers[:frames],
    )


def test_the_recording_is_that_of_the_trial(trial, exported):
    read, made = read_exact(exported / "exact.npz"), trial.recording
    np.testing.assert_array_equal(read.time, made.time)
    assert [camera.name for camera in read.rig] == [camera.name for camera in made.rig]
    for one, same in zip((*read.truth, *read.detections), (*made.truth, *made.detections), strict=True):
        for field in fields(same):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(same, field.name))


def test_scores_are_those_of_the_trial(trial, exported, people, tmp_path):
    (scores,) = score_submission(written(people, tmp_path), exported).scores.values()
    expected = trial.assessments["track-fast"].scores
    compared = [key for key in expected if not key.startswith(OF_LABELS) and key in SCORES]
    assert {"pcp", "map", "pck100", "recall", "ghosts", "hota", "idf1", "id_switches", "mpjpe_mm"} <= set(compared)
    assert 20 < expected["pcp"] < 100
    for key in compared:
        if expected[key] is None:
            assert scores[key] is None
        elif not key.startswith("coverage"):  # files have no covariances
            assert scores[key] == pytest.approx(expected[key], rel=1e-12, abs=1e-12), key


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda people: cut(people, 5), "has 5 frames, expected the 8 of quickstart"),
        (lambda people: replace(people, joints=1000 * people.joints), "trunks are .* m long, expected 0.15 to 0.9 m"),
    ],
    ids=["frames", "millimetres"],
)
def test_people_who_do_not_fit_are_refused(exported, people, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        score_submission(written(change(people), tmp_path), exported)


def test_a_folder_without_truth_is_refused(people, tmp_path):
    (tmp_path / "other").mkdir()
    with pytest.raises(ValueError, match=r"exact\.npz"):
        score_submission(written(people, tmp_path), tmp_path / "other")
    np.savez(tmp_path / "other" / "exact.npz", x=np.zeros(1))
    with pytest.raises(ValueError, match="is no exact truth of an exported sequence"):
        score_submission(written(people, tmp_path), tmp_path / "other")


@pytest.mark.slow
def test_a_benchmark_is_scored_by_split(trial, exported, people, tmp_path):
    benchmark = tmp_path / "benchmark"
    export_benchmark(trial.scenario, benchmark, BARE, sequences=2)
    for name in ("quickstart_0007", "quickstart_0008"):
        written(people, tmp_path / "submitted", name)
    result = score_submission(tmp_path / "submitted", benchmark)
    assert result.splits == {"quickstart_0007": "train", "quickstart_0008": "test"}
    (alone,) = score_submission(tmp_path / "submitted" / "quickstart_0007.npz", exported).scores.values()
    assert result.scores["quickstart_0007"]["pcp"] == alone["pcp"] == result.of("train", "pcp")[0]
    assert result.scores["quickstart_0008"]["pcp"] < alone["pcp"]  # people of another scene
    assert len(result.of("", "pcp")) == 2
    assert list(score_submission(tmp_path / "submitted", benchmark, split="test").scores) == ["quickstart_0008"]
    with pytest.raises(ValueError, match="has no sequence of the split val"):
        score_submission(tmp_path / "submitted", benchmark, split="val")
    words = ["score", str(tmp_path / "submitted"), str(benchmark), "--json", str(tmp_path / "scores.json")]
    printed = CliRunner().invoke(app, words, catch_exceptions=False)
    assert printed.exit_code == 0, printed.stderr
    rows = [line.split() for line in printed.stdout.splitlines()]
    assert ["train", "1", f"{alone['pcp']:.1f}"] in [row[:3] for row in rows]
    assert json.loads((tmp_path / "scores.json").read_text())["scores"]["quickstart_0007"]["pcp"] == alone["pcp"]
    shutil.copytree(tmp_path / "submitted", tmp_path / "more")
    (tmp_path / "more" / "quickstart_0008.npz").unlink()
    with pytest.raises(ValueError, match=r"one file or folder quickstart_0008 or quickstart_0008\.\* .* found 0"):
        score_submission(tmp_path / "more", benchmark)
