"""Hunts: what is found and in which circumstances, continued after an interruption, kept as failures."""

import json
from dataclasses import replace

import numpy as np
import pytest
from crowded_frames import crowd
from typer.testing import CliRunner

from simharness.cli import app
from simharness.hunt.hunt_run import BATCH, TRIALS, HuntedPoint, distinct, next_points
from simharness.hunt.hunted_trial import NOISES, HuntFinding, circumstances
from simharness.hunt.kept_failure import read_failure

SEARCHED = """
extends = "quickstart"
name = "searched"
duration = 0.4
rate = 5.0
variants = ["fast"]
[people]
spacing = 0.5
[rendering]
renderer = "rays"
[detector]
profile = "crowded"
[search]
people.count = { from = 2, to = 4, steps = 3 }
cameras.count = [3, 4]
detector.boxes.missed = { from = 0.6, to = 0.9, steps = 4 }
"""


@pytest.fixture
def hunt(tmp_path):
    (tmp_path / "searched.toml").write_text(SEARCHED)

    def call(*options, out="out"):
        words = ["hunt", str(tmp_path / "searched.toml"), "--out", str(tmp_path / out), *options]
        result = CliRunner().invoke(app, words)
        return result, tmp_path / out / "searched"

    return call


def content(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.slow
def test_a_hunt_finds_keeps_and_continues(hunt):
    options = ["--trials", "4", "--keep", "2"]
    result, folder = hunt(*options)
    assert result.exit_code == 0, result.output
    lines = [json.loads(line) for line in (folder / TRIALS).read_text().splitlines()]
    assert [row["trial"] for row in lines[1:]] == list(range(4))
    assert all(row["error"] == "" for row in lines[1:])
    assert any(row["findings"] for row in lines[1:])
    whole = content(folder)
    kept = sorted((folder / "failures").glob("*.toml"))
    assert 1 <= len(kept) <= 2
    for path in kept:
        failure = read_failure(path)
        assert failure.replay()[1]
        assert failure.text in result.stdout
    text = (folder / TRIALS).read_text()
    (folder / TRIALS).write_text("".join(text.splitlines(keepends=True)[:3]) + '{"trial": 3, "val')
    again, _ = hunt(*options)
    assert again.exit_code == 0, again.output
    restored = content(folder)
    assert sorted(restored.pop(TRIALS).splitlines()) == sorted(whole.pop(TRIALS).splitlines())
    assert restored == whole
    assert again.stdout == result.stdout
    refused, _ = hunt(*options, "--seed", "5")
    assert refused.exit_code == 2
    assert "another hunt" in refused.stderr


@pytest.mark.slow
def test_the_number_of_workers_changes_nothing(hunt):
    options = ["--trials", "4", "--keep", "1"]
    _, one = hunt(*options, out="one")
    _, two = hunt(*options, "--workers", "2", out="two")
    first, second = (sorted((folder / TRIALS).read_text().splitlines()) for folder in (one, two))
    assert first == second
    assert [path.name for path in (one / "failures").iterdir()] == [path.name for path in (two / "failures").iterdir()]


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--budget", "soon"], "--budget soon"),
        (["--set", "search={}"], "nothing to search"),
        (["--property", "luck"], "no such property"),
        (["--variant", "track"], "memory"),
    ],
)
def test_what_cannot_be_hunted(hunt, options, what):
    result, _ = hunt("--trials", "1", *options)
    assert result.exit_code == 2
    assert what in result.stderr


def finding(**changes):
    return replace(HuntFinding("merged", 0, 0, NOISES, "detection", 4.0, 0.5, 0.2, 0.2), **changes)


def test_near_twins_and_coincidences_do_not_count():
    found = [finding(), finding(distance=0.55, person=2), finding(distance=2.0), finding(overlap=0.9, failed=2)]
    points = [HuntedPoint(number, (), {}, number, (each,)) for number, each in enumerate(found)]
    cells = distinct(points, lambda each: each.cell)
    assert [point.seed for point, _ in cells.values()] == [0, 2]
    better = [HuntedPoint(number, (), {}, number, (finding(failed=3 + number),)) for number in (0, 1)]
    ((point, _),) = distinct(better, lambda each: each.cell[:2]).values()
    assert point.seed == 1


def test_circumstances():
    truth = crowd().truth[4]
    hips = truth.joints[:, 11:13].mean(axis=1)
    apart = np.linalg.norm(hips[:, None] - hips, axis=-1) + 100 * np.eye(len(hips))
    for person in range(len(hips)):
        found = circumstances(truth, person)
        assert found["distance"] == pytest.approx(apart[person].min(), abs=6e-4)
        visible = (truth.visibility[:, person] <= 1).mean(axis=-1)
        assert found["views"] == (visible >= 0.75).sum()
        assert found["hidden"] == pytest.approx(1 - visible.mean(), abs=6e-4)
    assert circumstances(truth, -1)["distance"] == pytest.approx(apart.min(), abs=6e-4)


ELITE = np.array([0.9, 0.1, 0.2])


def test_points_follow_from_the_seed_and_stay_in_the_cube():
    none, elites = np.zeros((0, 3)), np.array([[0.0, 1.0, 0.5], [1.0, 1.0, 0.0]])
    for known in (none, elites):
        points = np.concatenate([next_points(known, 3, 5, batch) for batch in range(20)])
        assert points.shape == (20 * BATCH, 3)
        assert points.min() >= 0
        assert points.max() <= 1
        np.testing.assert_array_equal(points[:BATCH], next_points(known, 3, 5, 0))
        assert not np.array_equal(points[:BATCH], next_points(known, 3, 6, 0))


def test_three_in_four_points_are_near_the_elites():
    points = np.concatenate([next_points(ELITE[None], 3, 5, batch) for batch in range(40)])
    near = np.linalg.norm(points - ELITE, axis=1) < 0.35
    assert 0.7 < near.mean() < 0.85
    away = np.concatenate([next_points(np.zeros((0, 3)), 3, 5, batch) for batch in range(40)])
    assert (np.linalg.norm(away - ELITE, axis=1) < 0.35).mean() < 0.1
    np.testing.assert_array_equal(points[::4], away[::4])


def test_points_along_the_way_between_two_elites():
    """Between two elites the spread is larger along the way from one to the other than across."""
    elites = np.array([[0.2, 0.5, 0.5], [0.8, 0.5, 0.5]])
    points = np.concatenate([next_points(elites, 3, 1, batch) for batch in range(60)])
    points = points[np.arange(len(points)) % 4 != 0]
    off = points - elites[np.abs(points[:, None] - elites).sum(axis=2).argmin(axis=1)]
    assert off[:, 1].std() == pytest.approx(0.1, abs=0.015)
    assert points[:, 0].std() > 2.5 * off[:, 1].std()
