"""Sentences above the figures of a run name what the figures show."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.outputs.run import standard_figures

NAN = np.nan


def test_the_median_counts_joints_that_were_not_found_as_infinitely_far() -> None:
    errors = {"full": np.array([10.0, 20.0, 30.0, NAN, NAN]), "fast": np.array([5.0, NAN, NAN])}
    assert standard_figures.joint_errors_finding(errors) == "Half of all joints are within 30 mm (full)."


@pytest.mark.parametrize(
    ("errors", "sentence"),
    [
        ([[20.0, 60.0], [NAN, 40.0]], "Person 1 is the hardest: 50 mm on average; person 0, the easiest, 20 mm."),
        ([[20.0, 22.0]], "No person stands out: means of 20 to 22 mm."),
        ([[20.0, NAN]], "Never found: person 1."),
        ([[20.0]], ""),
    ],
)
def test_who_is_hardest(errors: list[list[float]], sentence: str) -> None:
    assert standard_figures.people_finding(np.array(errors), np.ones((len(errors), len(errors[0])), bool)) == sentence


def test_people_who_never_come_are_not_looked_for() -> None:
    errors = np.array([[NAN, 20.0, 60.0], [NAN, NAN, 40.0]])
    present = np.array([[False, True, True], [False, False, True]])
    sentence = "Person 2 is the hardest: 50 mm on average; person 1, the easiest, 20 mm."
    assert standard_figures.people_finding(errors, present) == sentence


def test_the_camera_that_sees_least_and_why() -> None:
    shares = np.array([[0.7, 0.2, 0.1], [0.2, 0.3, 0.5]])
    sentence = standard_figures.visibility_finding(
        ["north", "south"], shares, ["visible", "behind a person", "outside"]
    )
    assert sentence == "south sees the fewest joints, 20 % (most others are outside); north sees 70 %."


def test_the_slowest_stage() -> None:
    times = {"full": {"affinity": 0.1, "matching": 0.6, "reconstruction": 0.3, "total": 1.1}}
    assert standard_figures.times_finding(times) == "full needs 1.1 ms for a frame, 60 % of it for matching."
    assert standard_figures.times_finding({"own": {"total": 2.0}}) == "own needs 2.0 ms for a frame."
    assert standard_figures.times_finding({}) == ""


def test_the_hardest_part() -> None:
    parts = {"pcp_parts": {"head": 100.0, "lower_arms": 88.0, "upper_arms": None}}
    sentence = "Lower arms are the hardest: 88.0 % of them are correct."
    assert standard_figures.parts_finding(parts, parts["pcp_parts"]) == sentence
    assert (
        standard_figures.parts_finding({"pcp_parts": {"head": 100.0}}, ["head"])
        == "Every body part is placed correctly."
    )
