"""Leaderboard: entries and studies that fit, closed forms of its figures, its page, and a whole small run."""

import csv
import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import benchmarks.leaderboard
from benchmarks.leaderboard.__main__ import PAGE, STUDIES, main
from benchmarks.leaderboard.entries import ENTRIES, Entry, chosen
from benchmarks.leaderboard.figures import (
    ALL,
    CHANGE,
    DIFFERENCE,
    OVERALL,
    RIG_SCORES,
    Figure,
    best_of_ours,
    rig_changes,
    study_figures,
    write_csv,
)
from benchmarks.leaderboard.page import cell_of, overall_table, render, rig_rows, rig_table, setting_table, text_rows
from benchmarks.leaderboard.shelf import evaluated, pcp, recording_figures
from benchmarks.leaderboard.views_plot import views_plot
from benchmarks.method.scenes import Conditions, film, ring
from mvpose import COCO17
from mvpose.skeleton import coco17_to_shelf14
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.statistics.intervals import Interval, mean_interval
from simharness.statistics.many_tests import holm
from simharness.statistics.paired_tests import paired
from simharness.trial.stages.estimators import load_estimator

FOLDER = Path(benchmarks.leaderboard.__file__).parent
FULL, FAST, RANSAC, LIMBS = (entry for entry in ENTRIES if entry.name in ("full", "fast", "ransac", "limbs"))


def figure(figures, method, setting, score):
    (found,) = [each for each in figures if (each.method, each.setting, each.score) == (method, setting, score)]
    return found


@pytest.fixture
def trials():
    """Two settings at six seeds: full gains a point a seed, ransac is 3 below, fast 8 below in one setting."""
    rows = []
    for seed in range(6):
        for case in ("base", "crowd"):
            level = (90.0 if case == "base" else 80.0) + seed
            loss = {"full": 0.0, "ransac": 3.0 + 0.1 * seed, "fast": 8.0 if case == "crowd" else 0.0}
            for variant, lost in loss.items():
                scores = dict.fromkeys(OVERALL, 1.0) | {"pcp": level - lost, "mpjpe_mm": 40.0 + lost}
                rows.append({"case": case, "seed": seed, "variant": variant, **scores})
    return pl.DataFrame(rows)


def test_studies_have_the_entries_of_the_leaderboard():
    for name in STUDIES:
        keys = tomllib.loads((FOLDER / f"{name}.toml").read_text())
        assert keys["variants"] == [entry.name for entry in ENTRIES]
        assert set(keys["method"]["estimators"]) == {entry.name for entry in ENTRIES if not entry.ours}
        assert min(range(keys["seed"], keys["seed"] + keys["seeds"])) > 100  # baselines and tuning have others


def test_entries_name_estimators_that_load_or_say_what_is_absent():
    for entry in ENTRIES:
        if not entry.ours and not entry.absent:
            assert callable(load_estimator(entry.place).estimate)
    absent = Entry("x", "package", "", "", ("no_such_module", "json"), "pip install x")
    assert absent.absent == "no_such_module cannot be imported: pip install x"
    assert replace(absent, modules=("json",)).absent == ""


def test_methods_are_chosen_by_name_with_one_of_ours():
    entries, skipped = chosen(["ransac", "full"])
    assert [entry.name for entry in entries] == ["full", "ransac"]
    assert not skipped
    with pytest.raises(ValueError, match="--method ransca: no such method; expected some of full, fast"):
        chosen(["full", "ransca"])
    with pytest.raises(ValueError, match="needs one of full, fast, no-3dps, hungarian, no-matching as well"):
        chosen(["ransac"])


def test_figures_are_means_over_seeds_and_paired_differences(trials):
    figures = study_figures(trials, [FULL, FAST, RANSAC], "case")
    base = mean_interval([90.0 + seed for seed in range(6)], unit="%")
    assert figure(figures, "full", "base", "pcp") == Figure("full", "base", "pcp", 92.5, base.low, base.high, 6)
    assert figure(figures, "full", ALL, "pcp").value == pytest.approx(87.5)
    assert figure(figures, "ransac", ALL, "mpjpe_mm").value == pytest.approx(43.25)
    assert best_of_ours(figures, [FULL, FAST, RANSAC]) == "full"
    tests = {
        "fast": paired([85.0 + seed for seed in range(6)], [81.0 + seed for seed in range(6)]),
        "ransac": paired([85.0 + seed for seed in range(6)], [82.0 + 0.9 * seed for seed in range(6)]),
    }
    for (name, test), p in zip(tests.items(), holm([each.p for each in tests.values()]), strict=True):
        found = figure(figures, name, ALL, DIFFERENCE)
        expected = [test.difference, test.low, test.high, p]
        assert [found.value, found.low, found.high, found.p] == pytest.approx(expected)
        assert found.n == 6
    assert not [each for each in figures if each.method == "full" and each.score == DIFFERENCE]


def test_the_best_of_ours_is_never_a_method_of_others(trials):
    figures = study_figures(trials.with_columns(pl.col("variant").replace({"full": "limbs"})), [LIMBS, FAST], "case")
    assert best_of_ours(figures, [LIMBS, FAST]) == "fast"
    assert figure(figures, "limbs", ALL, DIFFERENCE).value == pytest.approx(4.0)


def test_tables_are_ranked_and_mark_the_best_of_each_setting(trials):
    entries = [FAST, RANSAC, FULL]
    figures = study_figures(trials, entries, "case")
    overall, settings = overall_table(figures, entries), setting_table(figures, entries)
    assert [name for name, _ in overall.rows] == [name for name, _ in settings.rows] == ["full", "ransac", "fast"]
    assert [head.text for head in settings.heads] == ["base", "crowd"]
    marks = {name: [(cell.strong, round(cell.share, 3)) for cell in cells] for name, cells in settings.rows}
    assert marks["full"] == [(True, 0.0), (True, 0.0)]
    assert marks["fast"] == [(True, 0.0), (False, 0.4)]  # 8 of 20 points
    assert [row[0] for row in text_rows(figures, entries)] == ["full", "ransac", "fast"]
    assert dict(overall.rows)["fast"][1].text == "−4.0"


def test_cells_of_differences_are_bold_where_they_are_significant():
    shown = Figure("x", ALL, DIFFERENCE, -2.0, -3.0, 0.5, 12, p=0.2)
    assert not cell_of(shown).strong
    assert cell_of(replace(shown, p=0.01)).strong
    assert cell_of(replace(shown, p=float("nan"), high=-0.5)).strong  # not tested: the interval decides
    assert cell_of(None).text == cell_of(replace(shown, value=float("nan"))).text == "–"


RIGS = {"cmu0": 0.0, "cmu3": -6.0, "cmu1": 2.0}
"""mAP of three rigs, less that of cmu0."""


@pytest.fixture
def rig_trials():
    """Three rigs at six seeds: a seed adds the same to mAP with every rig; a point of mAP is 2 mm of MPJPE."""
    rows = []
    for seed in range(6):
        for rig, gain in RIGS.items():
            for variant, level in {"full": 70.0, "ransac": 60.0}.items():
                wobble = 0.5 * (-1) ** seed if rig == "cmu3" else 0.0
                scores = {"map": level + 3.0 * seed + gain + wobble, "mpjpe_mm": 60.0 - 2.0 * (3.0 * seed + gain)}
                known = dict.fromkeys((*OVERALL, *RIG_SCORES), 90.0 - (variant == "ransac"))
                rows.append({"cameras.preset": rig, "seed": seed, "variant": variant, **known, **scores})
    return pl.DataFrame(rows)


def test_changes_from_one_rig_to_another_are_paired_by_seed(rig_trials):
    figures = rig_changes(rig_trials, [FULL, RANSAC], "cameras.preset")
    alone = mean_interval([64.0 + 3.0 * seed + 0.5 * (-1) ** seed for seed in range(6)], unit="%")
    for name in ("full", "ransac"):
        change = figure(figures, name, "cmu3", "map" + CHANGE)
        assert change.value == pytest.approx(-6.0)
        assert change.n == 6
        assert -7.5 < change.low < -6.0 < change.high < -4.5
        assert change.high - change.low < 0.3 * (alone.high - alone.low)  # seeds differ by more than rigs
        assert figure(figures, name, "cmu1", "mpjpe_mm" + CHANGE).value == pytest.approx(-4.0)
    assert not [each for each in figures if each.setting == "cmu0"]


def test_rigs_have_their_cameras_scores_and_changes(rig_trials):
    entries = [FULL, RANSAC]
    figures = study_figures(rig_trials, entries, "cameras.preset", RIG_SCORES)
    figures += rig_changes(rig_trials, entries, "cameras.preset")
    rows = dict(rig_table(figures, entries).rows)
    assert [(rig, cells[0].text) for rig, cells in rows.items()] == [("cmu0", "5"), ("cmu3", "4"), ("cmu1", "7")]
    assert [(cell.text, cell.strong) for cell in rows["cmu3"][-2:]] == [("−6.0", True), ("+12.0", True)]
    assert rows["cmu0"][-1].text == "–"
    assert [row[0] for row in rig_rows(figures, entries)] == ["cmu0", "cmu3", "cmu1"]
    best = {score: dict(setting_table(figures, entries, score).rows) for score in ("map", "mpjpe_mm")}
    assert [cell.strong for cell in best["map"]["full"]] == [True] * 3
    assert best["mpjpe_mm"]["full"][1].strong  # equal to that of ransac, and the least
    assert best["map"]["ransac"][0].share == pytest.approx(0.5)  # 10 of 20 points behind
    page = render({"rigs": figures}, entries, {})
    for text in ("Other rigs of Panoptic", "MV-SSM", "CVPR 2025", "not of the data above", "−6.0"):
        assert text in page


def test_published_figures_have_a_source():
    published = tomllib.loads((FOLDER / "published_rigs.toml").read_text())["figures"]
    assert {tuple(each) for each in published} == {("method", "trained", "change", "figures", "source")}
    assert all(each["source"] for each in published)


def test_the_less_the_better_for_errors(rig_trials):
    worse = rig_trials.with_columns(mpjpe_mm=pl.col("mpjpe_mm") + 10.0 * (pl.col("variant") == "ransac"))
    figures = study_figures(worse, [FULL, RANSAC], "cameras.preset", RIG_SCORES)
    rows = dict(setting_table(figures, [FULL, RANSAC], "mpjpe_mm").rows)
    assert [(cell.strong, round(cell.share, 6)) for cell in rows["full"]] == [(True, 0.0)] * 3
    assert [(cell.strong, round(cell.share, 6)) for cell in rows["ransac"]] == [(False, 0.5)] * 3


def test_csv_has_all_figures(trials, tmp_path):
    figures = study_figures(trials, [FULL, RANSAC], "case")
    write_csv(figures, tmp_path / "board.csv")
    with (tmp_path / "board.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["method"], row["setting"], row["score"]) for row in rows] == [
        (each.method, each.setting, each.score) for each in figures
    ]
    assert [float(row["value"]) for row in rows] == pytest.approx([each.value for each in figures])
    assert rows[0]["p"] == ""


def result(correct, counted=10, frames=50):
    summary = {
        "precision": 0.5,
        "recall": None,
        "mpjpe_mm": {"mean": 40.0},
        "ghosts_per_frame": 2.0,
        "timings_ms": {"total": {"median": 3.0}},
    }
    correct = np.broadcast_to(correct, (frames, 2))
    time = (np.arange(frames) / 25.0).tolist()
    counts = {"correct": correct.tolist(), "counted": [[counted, counted]] * frames}
    fewer = {"2": {"correct": (3 * correct - 1).tolist(), "counted": [[3 * counted, 3 * counted]] * frames}}
    return {"time": time, **counts, "fewer": fewer, "summary": summary}


def test_pcp_of_a_recording_is_that_of_its_parts_with_equal_weight_of_actors():
    some = result([10, 5])
    some["counted"][0] = [10, 0]  # the second actor is not annotated in the first frame
    some["correct"][0] = [0, 0]
    np.testing.assert_allclose(pcp(some, np.ones((1, 50))), [[98.0, 50.0]])
    figures = recording_figures({"full": result([10, 5]), "ransac": result([9, 5])}, [FULL, RANSAC])
    assert figure(figures, "full", ALL, "pcp").value == pytest.approx(75.0)
    assert figure(figures, "ransac", "actor 1", "pcp").value == pytest.approx(90.0)
    assert figure(figures, "full", "2 cameras", "pcp").value == pytest.approx((29 + 14) / 60 * 100)
    found = figure(figures, "ransac", ALL, DIFFERENCE)
    assert [found.value, found.low, found.high] == pytest.approx([-5.0, -5.0, -5.0])  # the same in all blocks
    assert found.n == 2
    assert figure(figures, "ransac", ALL, "precision").value == 50.0


def test_differences_on_a_recording_are_paired_by_frame():
    hard = np.where(np.arange(50)[:, None] < 25, 2, 10) * np.ones((50, 2), int)
    figures = recording_figures({"full": result(hard), "ransac": result(hard - 1)}, [FULL, RANSAC])
    alone, both = figure(figures, "full", ALL, "pcp"), figure(figures, "ransac", ALL, DIFFERENCE)
    assert alone.high - alone.low > 20.0
    assert [both.value, both.low, both.high] == pytest.approx([-10.0, -10.0, -10.0])


def test_finished_methods_of_a_recording_are_kept(tmp_path):
    rig = ring(4, 2)
    scenes = [film(rig, 2, conditions=Conditions(0.0, 0.0, 0.0))] * 3
    truth = np.stack([coco17_to_shelf14(scene.joints) for scene in scenes])
    recording = AnnotatedRecording(rig, truth, tuple(scene.detections for scene in scenes), np.arange(3))
    steps = []
    first = evaluated(recording, [FAST, RANSAC], tmp_path, steps.append)
    assert steps == [1, 1]
    assert figure(first, "ransac", ALL, "pcp").value == 100.0
    assert [figure(first, "fast", f"{count} cameras", "pcp").value for count in (2, 3)] == [100.0, 100.0]
    (kept,) = tmp_path.glob("fast-*.json")
    assert (
        np.sum(json.loads(kept.read_text())["fewer"]["2"]["counted"]) == 6 * 3 * 2 * 10
    )  # sets, frames, people, parts
    assert len(COCO17) == scenes[0].joints.shape[1]
    files = {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()}
    assert len(files) == 2
    again = evaluated(recording, [FAST, RANSAC], tmp_path, steps.append)
    assert {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()} == files
    assert str(again) == str(first)


def test_the_page_names_methods_numbers_and_what_is_missing(trials):
    entries = [FULL, RANSAC]
    page = render({"conditions": study_figures(trials, entries, "case")}, entries, {"pose2sim": "it is <not> there"})
    for text in ("Leaderboard", "Fourteen conditions", "87.5", "−3.2", "plain baseline", "it is &lt;not&gt; there"):
        assert text in page
    assert "Real Shelf" not in page


def test_the_plot_has_a_line_for_each_method_also_where_nothing_is_wrong():
    level = {"full": [90.0, 100.0], "ransac": [50.0, 99.0]}
    lines = {name: [Interval(pcp, pcp - 1, min(pcp + 1, 100.0), 6) for pcp in of] for name, of in level.items()}
    given = {"title": "others", "colors": {"full": 0, "ransac": 7}, "span": (50.0, 100.0)}
    svg = views_plot("x", lines, [2, 8], **given)
    assert svg.startswith("<svg")
    assert "NaN" not in svg
    texts = re.findall(r">([^<>]+)</text>", svg)
    assert {"full", "ransac", "others", "50", "90", "99", "99.9"} <= set(texts)


def test_wrong_arguments_are_one_message(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main([str(tmp_path), "--method", "nobody"])
    assert "no such method" in capsys.readouterr().err


@pytest.mark.slow
def test_a_small_leaderboard_is_run_printed_and_continued(tmp_path, capsys):
    small = ["--set", "duration=0.2", "sweep.cameras.count=[3, 5]"]
    command = [str(tmp_path), "--only", "views", "--seeds", "2", "--method", "fast", "ransac", "limbs", *small]
    assert main(command) == 0
    printed = capsys.readouterr().out
    assert "Number of views" in printed
    assert "ransac" in printed
    page = (tmp_path / PAGE).read_text()
    assert page.count("<svg") == 2
    with (tmp_path / "views.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["score"] == "pcp" and row["setting"] != ALL]
    assert {(row["method"], row["setting"]) for row in rows} == {
        (name, views) for name in ("fast", "ransac", "limbs") for views in ("3", "5")
    }
    assert main(command) == 0
    assert json.loads((tmp_path / "views" / "study.json").read_text())["run"] == 0
