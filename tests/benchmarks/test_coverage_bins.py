"""Coverage: bins of the people of trials and recordings, and combinations that nobody tested."""

import itertools
import json

import numpy as np
import polars as pl
import pytest
from crowded_frames import crowd
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from benchmarks.hunt.coverage import main
from benchmarks.hunt.coverage_bins import (
    SCHEMA,
    bin_text,
    bins,
    coverage,
    found_alike,
    hunt_sightings,
    recording_sightings,
)
from mvpose import preset
from simharness.cli import app
from simharness.hunt.hunted_trial import CIRCUMSTANCES, circumstances, sightings

NAMES = list(CIRCUMSTANCES)
PEOPLE = st.tuples(
    *(st.integers(0, len(borders)) for borders in CIRCUMSTANCES.values()),
    st.sampled_from("abc"),
    st.integers(0, 10),
    st.just(10),
)


def table(rows):
    return pl.DataFrame(rows, schema=SCHEMA, orient="row")


@given(st.lists(PEOPLE, max_size=30), st.sampled_from([1, 2, 3]))
def test_counts_are_those_by_hand(rows, strength):
    found = coverage(table(rows), strength)
    for names in itertools.combinations(range(len(NAMES)), strength):
        for places in itertools.product(*(range(len(CIRCUMSTANCES[NAMES[k]]) + 1) for k in names)):
            those = [row for row in rows if all(row[k] == place for k, place in zip(names, places, strict=True))]
            key = tuple((NAMES[k], place) for k, place in zip(names, places, strict=True))
            if key not in found:
                assert not those
                continue
            trials, people, pcp = found[key]
            assert (trials, people) == (len({row[-3] for row in those}), len(those))
            expected = 100 * np.mean([row[-2] / 10 for row in those]) if those else np.nan
            assert pcp == pytest.approx(expected, nan_ok=True)


def test_combinations_that_cannot_occur_are_left_out():
    alone, near = ("people", 0), ("distance", 0)
    few, many = ("cameras", 0), ("views", 3)
    pairs, triples = coverage(table([]), 2), coverage(table([]), 3)
    assert not any({alone, near} <= set(each) or {few, many} <= set(each) for each in (*pairs, *triples))
    assert all(trials == 0 for trials, *_ in pairs.values())
    sizes = [len(borders) + 1 for borders in CIRCUMSTANCES.values()]
    assert len(pairs) == sum(a * b for a, b in itertools.combinations(sizes, 2)) - 6


def test_words_of_bins_are_distinct_and_have_the_borders():
    texts = [bin_text(each) for each in bins()]
    assert len(set(texts)) == len(texts)
    for name, borders in CIRCUMSTANCES.items():
        if name in ("distance", "overlap"):
            assert all(any(f"{border:g}" in text for text in texts if text.startswith(name)) for border in borders)


@pytest.mark.slow
def test_people_of_a_frame_are_in_the_bins_of_their_circumstances():
    recording = crowd()
    for truth in recording.truth:
        people = np.flatnonzero(truth.present)
        found = np.array(sightings(truth))
        assert found.shape == (len(people), len(NAMES))
        for row, person in zip(found, people, strict=True):
            about = circumstances(truth, int(person)) | {"people": len(people), "cameras": len(recording.rig)}
            for value, (name, borders) in zip(row, CIRCUMSTANCES.items(), strict=True):
                low, high = (-np.inf, *borders)[value], (*borders, np.inf)[value]
                assert low <= about[name] <= high


def test_a_recording_without_truth_lies_in_the_bins_of_its_truth():
    """Estimates of accurate detections give the same distances, overlaps, people and cameras.

    The detector reports hidden joints as well, so that people look less hidden, and in more views.
    """
    recording = crowd("detector.profile=perfect")
    answers = [preset("full").estimate(recording.rig, each) for each in recording.detections]
    own = recording_sightings(recording.rig, recording.detections, answers).select(NAMES).to_numpy()
    true = np.array([each for truth in recording.truth for each in sightings(truth)])
    assert len(own) == pytest.approx(len(true), rel=0.1)
    mean = dict(zip(NAMES, own.mean(axis=0) - true.mean(axis=0), strict=True))
    assert mean["views"] > 0
    assert mean["hidden"] < 0
    for k in map(NAMES.index, ("distance", "overlap", "people", "cameras")):
        shares = [np.bincount(each[:, k], minlength=4) / len(each) for each in (own, true)]
        assert np.abs(shares[0] - shares[1]).sum() / 2 < 0.15, NAMES[k]


def test_a_recording_of_nobody_is_in_no_bin():
    recording = crowd()
    nobody = [each.select(np.zeros(0, int)) for each in recording.detections]
    answers = [preset("full").estimate(recording.rig, each) for each in nobody]
    assert len(recording_sightings(recording.rig, nobody, answers)) == 0
    assert found_alike(table([]), table([]))[0] == 0.0


def test_scores_for_a_recording_are_those_of_its_bins():
    here, there = (0, 1, 1, 1, 1, 1), (3, 2, 0, 0, 1, 1)
    tested = table([(*here, "a", 8, 10), (*here, "b", 6, 10), (*there, "a", 1, 10)])
    elsewhere = (1, 1, 1, 1, 1, 1)
    own = table([(*each, "0", 0, 0) for each in (here, here, here, elsewhere)])
    share, pcp = found_alike(tested, own)
    assert (share, pcp) == (0.75, pytest.approx(70.0))


def test_hunts_count_people_without_scores(tmp_path):
    file = tmp_path / "trials.jsonl"
    rows = [{"trial": k, "sightings": [[1, 1, 1, 1, 1, 1]] * k} for k in range(3)]
    file.write_text("\n".join(map(json.dumps, [{}, *rows])) + "\n")
    assert coverage(hunt_sightings(file), 1)[("views", 1),][:2] == (2, 3)
    file.write_text(json.dumps({}) + "\n")
    with pytest.raises(ValueError, match="has no circumstances of people; hunt again"):
        hunt_sightings(file)


@pytest.mark.slow
def test_the_command_writes_a_page_and_runs_no_trial_twice(tmp_path, capsys):
    scenario = tmp_path / "few.toml"
    scenario.write_text(
        'extends = "quickstart"\nname = "few"\nduration = 0.2\nrate = 10.0\nrendering.renderer = "rays"\n'
        "[search]\npeople.count = [2, 3]\n"
    )
    hunted = ["hunt", str(scenario), "--trials", "2", "--keep", "0", "--out", str(tmp_path / "hunts")]
    assert CliRunner().invoke(app, hunted).exit_code == 0
    words = [str(scenario), str(tmp_path / "hunts" / "few"), "--out", str(tmp_path / "page.html")]
    words += ["--store", str(tmp_path / "store")]
    main(words)
    assert "combinations of 2 bins were tested" in capsys.readouterr().out
    page = (tmp_path / "page.html").read_text()
    assert "3 trials" in page
    assert "Not tested" in page
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "store").rglob("*") if file.is_file()}
    main(words)
    assert {file: file.stat().st_mtime_ns for file in before} == before
