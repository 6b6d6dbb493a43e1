"""Hunts: what is found and in which circumstances, continued after an interruption, kept as failures."""

import json
from dataclasses import replace

import numpy as np
import pytest
from crowded_frames import crowd
from typer.testing import CliRunner

from simharness.cli import app
from simharness.hunt.hunt_run import BATCH, TRIALS, HuntedPoint, distinct, elites_of, next_points
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


NONE = np.zeros((0, 3))
ELITES = np.array([[0.2, 0.5, 0.5], [0.8, 0.5, 0.5]])


def points_of(elites, weights=None, *, batches=60, seed=5):
    """Points of several batches (n, d), and the elites whose scenes they keep (n,)."""
    weights = np.ones(len(elites)) if weights is None else np.array(weights)
    found = [next_points(elites, weights, 3, seed, batch) for batch in range(batches)]
    return np.concatenate([points for points, _ in found]), np.concatenate([kept for _, kept in found])


def test_points_follow_from_the_seed_and_stay_in_the_cube():
    for known in (NONE, np.array([[0.0, 1.0, 0.5], [1.0, 1.0, 0.0]])):
        points, kept = points_of(known, batches=20)
        assert points.shape == (20 * BATCH, 3)
        assert points.min() >= 0
        assert points.max() <= 1
        again = points_of(known, batches=20)
        np.testing.assert_array_equal(points, again[0])
        np.testing.assert_array_equal(kept, again[1])
        assert not np.array_equal(points, points_of(known, batches=20, seed=6)[0])


def test_three_in_four_points_are_near_the_elites_and_half_of_them_in_their_scenes():
    points, kept = points_of(ELITES[1:])
    near = np.linalg.norm(points - ELITES[1], axis=1) < 0.35
    assert 0.7 < near.mean() < 0.85
    away, new = points_of(NONE)
    assert (np.linalg.norm(away - ELITES[1], axis=1) < 0.35).mean() < 0.15
    np.testing.assert_array_equal(points[::4], away[::4])
    assert set(new) == {-1}
    assert set(kept[::4]) == {-1}
    assert 0.3 < (kept == 0).mean() < 0.45


def test_elites_are_varied_as_often_as_their_weights():
    points, kept = points_of(ELITES, [1.0, 3.0])
    assert 0.66 < (kept[kept >= 0] == 1).mean() < 0.84
    for elite in (0, 1):
        of_it = points[kept == elite]
        assert np.abs(of_it - ELITES[elite]).mean(axis=0)[1:].max() < 0.12


def test_points_along_the_way_between_two_elites():
    """Between two elites the spread is larger along the way from one to the other than across."""
    points, kept = points_of(ELITES)
    points, kept = points[kept >= 0], kept[kept >= 0]
    off = points - ELITES[kept]
    assert off[:, 1].std() == pytest.approx(0.1, abs=0.015)
    assert 1.1 * off[:, 1].std() < off[:, 0].std() < 1.6 * off[:, 1].std()


def test_all_kinds_of_failures_are_varied_alike_often_and_reliable_ones_more():
    """Five kinds of circumstances of one failure have together the weight of the only one of another."""
    found = [finding(overlap=overlap, distance=2.0 * far) for overlap in (0.0, 0.2, 0.9) for far in (0, 1)]
    found = [*found[:5], finding(violated="ghost"), finding(violated="missed", failed=0)]
    found[0] = replace(found[0], failed=1)
    points = [HuntedPoint(number, (), {}, number, (each,)) for number, each in enumerate(found)]
    parents, weights = elites_of(points)
    assert [each.seed for each in parents] == list(range(6))
    assert weights[:5].sum() == pytest.approx(weights[5])
    assert weights[1] == pytest.approx(NOISES * weights[0])
