"""Baseline files: written, read back, and refused when damaged."""

import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.gate.baseline import KEPT, Measurement, read_baseline, write_baseline
from simharness.gate.trial_command import TrialKey

VALUES = st.none() | st.floats(-1e6, 1e6)
TRIALS = st.builds(TrialKey, st.text(min_size=1), st.integers(0, 99), st.sampled_from(["full", "fast"]))
SCORES = st.dictionaries(TRIALS, st.fixed_dictionaries(dict.fromkeys(KEPT, VALUES)), max_size=5)


def measurement(**scores):
    every = dict.fromkeys(KEPT, 1.0) | scores
    return Measurement(
        "ci", "0123456789", "1.0", "zen", {TrialKey("b", 2, "full"): every, TrialKey("a", 10, "full"): every}
    )


@given(scores=SCORES)
def test_a_baseline_is_read_as_it_was_written(scores, tmp_path_factory):
    path = tmp_path_factory.mktemp("baseline") / "ci.json"
    written = Measurement("ci", "0123456789", "1.0", "zen", scores)
    write_baseline(written, path)
    assert read_baseline(path) == written
    assert list(path.parent.iterdir()) == [path]


def test_a_trial_is_a_line_and_one_that_changes_changes_one_line(tmp_path):
    path = tmp_path / "new" / "ci.json"
    write_baseline(measurement(), path)
    before = path.read_text().splitlines()
    assert len(json.loads("\n".join(before))["trials"]) == 2
    changed = measurement()
    changed.scores[TrialKey("b", 2, "full")]["pcp"] = 3.25
    write_baseline(changed, path)
    after = path.read_text().splitlines()
    assert [old == new for old, new in zip(before, after, strict=True)].count(False) == 1


def test_lines_are_sorted_independently_of_the_order_of_the_trials(tmp_path):
    path, other = tmp_path / "one.json", tmp_path / "other.json"
    write_baseline(measurement(), path)
    turned = Measurement("ci", "0123456789", "1.0", "zen", dict(reversed(measurement().scores.items())))
    write_baseline(turned, other)
    assert path.read_bytes() == other.read_bytes()


def test_nan_becomes_none_and_scores_are_rounded():
    scores = measurement(pcp=float("nan"), recall=97.123456).scores[TrialKey("a", 10, "full")]
    assert (scores["pcp"], scores["recall"]) == (None, 97.1235)


def spoilt(path, change):
    write_baseline(measurement(), path)
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data.pop("fingerprint"), "the key 'fingerprint' is missing"),
        (lambda data: data.update(suite=3), "suite: expected text, got 3"),
        (lambda data: data.update(trials={"a": 1}), "trials: expected objects"),
        (lambda data: data.update(trials=None), "not a baseline"),
        (lambda data: data["trials"][0].pop("pcp"), "the key 'pcp' is missing"),
        (lambda data: data["trials"][0].update(pcp="97"), 'a, seed 10, full: pcp: expected a number or null, got "97"'),
        (lambda data: data["trials"][0].update(pcp=True), "expected a number or null, got true"),
        (lambda data: data["trials"][0].update(seed="x"), "expected case, seed and variant"),
    ],
)
def test_an_invalid_baseline_is_refused(tmp_path, change, message):
    path = tmp_path / "ci.json"
    spoilt(path, change)
    with pytest.raises(ValueError, match="--update-baseline") as error:
        read_baseline(path)
    assert str(path) in str(error.value)
    assert message in str(error.value)


@pytest.mark.parametrize("content", [b"", b'{"suite": "ci",\n "trials": [', b"[1, 2]", b"\xff\xfe\x00"])
def test_an_incomplete_or_foreign_file_is_refused(tmp_path, content):
    path = tmp_path / "ci.json"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"ci\.json.*--update-baseline"):
        read_baseline(path)


def test_a_missing_baseline_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"ci\.json: no such file; write one with --update-baseline"):
        read_baseline(tmp_path / "ci.json")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_an_unwritable_folder_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ValueError, match="cannot be written: Permission denied"):
        write_baseline(measurement(), tmp_path / "ci.json")


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="cannot be written"):
        write_baseline(measurement(), tmp_path / "file" / "ci.json")
    assert [each.name for each in tmp_path.iterdir()] == ["file"]
