"""Terminal tables of evaluations."""

import io
import json
from dataclasses import replace

import numpy as np
from rich.console import Console
from small_recording import PERSON, Fixed, small_recording

from simharness.cli.score_tables import print_evaluation
from simharness.reality.evaluation import evaluate


def printed(evaluation):
    """Return the printed tables of an evaluation as text."""
    stream = io.StringIO()
    print_evaluation(evaluation, Console(file=stream, width=100))
    return stream.getvalue()


def test_the_tables_name_the_head_mapping_and_the_paper_and_fit_100_columns():
    text = printed(evaluate(small_recording("2019"), {"full": Fixed(PERSON), "custom": Fixed([])}, head="2019"))
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    assert "head mapping 2019" in lines[0]
    rows = [line.split() for line in lines]
    assert ["1", *["100.0"] * 7, "98.8"] in rows
    assert ["2", *["0.0"] * 7, "94.1"] in rows
    assert ["3", *["–"] * 7, "97.8"] in rows
    assert ["average", *["50.0"] * 7, "96.9"] in rows
    assert ["average", *["0.0"] * 7] in rows  # no published number for a method of another name
    assert ["full", "100.0", "66.7", "0.00", "0.50", "0.0", "0.0", "0"] in rows
    assert ["custom", "–", "0.0", "0.00", "1.50", "–", "–", "0"] in rows
    assert ["full", "1.00", "(1.00)", "2.00", "(2.00)", "3.00", "(3.00)", "6.00", "(6.00)"] in rows


def test_several_variants_have_a_common_table_with_rows_of_the_paper():
    text = printed(evaluate(small_recording("2019"), {"no-matching": Fixed(PERSON), "custom": Fixed([])}, head="2019"))
    rows = [line.split() for line in text.splitlines()]
    first = rows.index(["no-matching", "100.0", "0.0", "–", "50.0"])
    assert rows[first + 1 : first + 3] == [
        ["paper", "98.1", "91.1", "92.8", "94.0"],
        ["custom", "0.0", "0.0", "–", "0.0"],
    ]


class Renaming(Fixed):
    """Estimator that gives its people other identities in every frame."""

    def estimate(self, rig, detections):
        fixed = super().estimate(rig, detections)
        return replace(fixed, ids=self.calls * 10 + np.arange(len(fixed)))


def test_variants_with_identities_have_a_table():
    """Actor 1 has two identities in two frames; the second person, who is not annotated in frame 1, costs nothing."""
    methods = {"full": Fixed(PERSON), "track": Renaming([PERSON, PERSON + np.array([2, 0, 0])])}
    evaluation = evaluate(small_recording("2019"), methods, head="2019")
    text = printed(evaluation)
    assert max(map(len, text.splitlines())) <= 100
    assert ["track", "75.0", "66.7", "0.0", "1", "500.00", "0"] in [line.split() for line in text.splitlines()]
    summary = json.loads(json.dumps(evaluation.summary(), allow_nan=False))["variants"]
    assert "tracking" not in summary["full"]
    assert summary["track"]["tracking"]["root"]["0.25"]["id_switches"] == 1
    assert "Identities" not in printed(evaluate(small_recording("2019"), {"full": Fixed(PERSON)}, head="2019"))
