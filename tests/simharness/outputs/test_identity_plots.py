"""Plots of identities: what their bars, colours, marks and paths stand for."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from test_page import make_record

from mvpose import Estimate, Matching
from mvpose.report.palette import UNMATCHED, css, identity_color, line_color
from mvpose.report.recording_plots import runs_of
from simharness.outputs.run.identity_plots import identities_of, timeline, trajectories
from simharness.outputs.run.page import render
from simharness.scoring.tracking.identity_figures import tracking_summary

BODY = np.random.default_rng(0).normal(0, 0.3, (17, 3))
GREY = css(UNMATCHED)


def made(frames=20, people=3, *, ids=None, found=None, moved=0.0, ghosts=()):
    """Return truth, estimates and times of people who stand 2 m apart.

    Args:
        frames: number of frames.
        people: number of people.
        ids: identity of each person, or a function of the frame that returns it.
        found: function of frame and person that says who has an estimate.
        moved: how far the people walk along y in all frames together, metres.
        ghosts: frames in which there is one, with the identity 77.
    """
    truth = np.tile(BODY, (frames, people, 1, 1)) + [2.0, 0, 0] * np.arange(people)[:, None, None]
    truth[..., 1] += np.linspace(0, moved, frames)[:, None, None]
    estimates = []
    for frame, joints in enumerate(truth):
        names = np.array(ids(frame) if callable(ids) else ids or range(people))
        there = np.array([found is None or found(frame, person) for person in range(people)], bool)
        estimated, names = joints[there], names[there]
        if frame in ghosts:
            estimated, names = np.concatenate([estimated, BODY[None] - [9.0, 0, 0]]), np.append(names, 77)
        estimates.append(Estimate(estimated, np.ones(estimated.shape[:2]), Matching([]), ids=names))
    return truth, estimates, np.arange(frames) / 10


def bars(svg, color):
    """Count the filled shapes of a colour."""
    return len(re.findall(rf'style="fill: {color}"', svg))


def test_a_bar_is_a_stretch_of_one_identity():
    """Person 0 changes its identity, person 1 is missed for a while, and person 2 leaves."""
    truth, estimates, time = made(
        ids=lambda frame: [5 if frame < 10 else 6, 7, 8], found=lambda frame, person: person != 1 or not 5 <= frame < 9
    )
    truth[15:, 2] = np.nan
    identities = identities_of(truth, estimates, time)
    by_name = dict(zip(identities.frames.ids.tolist(), identities.colors, strict=True))
    assert [by_name[7], by_name[8]] == [line_color(1), line_color(2)]
    assert {by_name[5], by_name[6]} == {line_color(0), identity_color(3)}
    svg = timeline("t", identities)
    assert [bars(svg, by_name[name]) for name in (5, 6, 7, 8)] == [1, 1, 2, 2]  # the last: a bar, and a ghost's
    assert [len(re.findall(rf">{name}<", svg)) for name in (5, 6, 7)] == [1, 1, 2]
    for text in ("missed", "absent", "identity switch", "ghosts", "person 0", "person 2"):
        assert f">{text}<" in svg


def test_a_perfect_timeline_shows_nothing_else():
    svg = timeline("t", identities_of(*made()))
    for text in ("missed", "absent", "identity switch", "ghosts"):
        assert text not in svg
    assert [bars(svg, line_color(person)) for person in range(3)] == [1, 1, 1]


def test_ghosts_are_grey_and_below():
    identities = identities_of(*made(ghosts=(3, 4, 12)))
    assert [(int(identities.frames.ids[track]), frames.tolist()) for track, frames in identities.ghosts] == [
        (77, [3, 4, 12])
    ]
    assert identities.colors[-1] == GREY
    assert bars(timeline("t", identities), GREY) == 2


def test_more_ghosts_than_rows_are_counted():
    truth, estimates, time = made(frames=5, people=1)
    extra = np.tile(BODY, (13, 1, 1)) + [0, 0, 5.0] * np.arange(1, 14)[:, None, None]
    crowded = [
        Estimate(np.concatenate([each.joints, extra]), np.ones((14, 17)), Matching([]), ids=np.arange(14))
        for each in estimates
    ]
    assert "ghosts (+5)" in timeline("t", identities_of(truth, crowded, time))


def test_paths_end_where_an_identity_goes_over_to_another_person_or_is_lost():
    swapped = identities_of(*made(ids=lambda frame: [0, 1, 2] if frame < 8 else [1, 0, 2], moved=1.0))
    assert [(track, len(places)) for track, places in swapped.stretches] == [(0, 8), (0, 12), (1, 8), (1, 12), (2, 20)]
    lost = identities_of(*made(found=lambda frame, person: person or frame % 7, moved=1.0))
    assert [len(places) for track, places in lost.stretches if track == 0] == [6, 6, 5]
    for identities in (swapped, lost):
        for _, places in identities.stretches:
            assert np.linalg.norm(np.diff(places, axis=0), axis=1).max(initial=0) < 0.2
    drawn = trajectories("t", swapped)
    assert ">switch<" in drawn
    assert ">switch<" not in trajectories("t", lost)


@pytest.mark.slow
@pytest.mark.parametrize("draw", [timeline, trajectories])
@pytest.mark.parametrize(
    "case",
    [
        {"frames": 1},
        {"frames": 1, "people": 1, "found": lambda *_: False},
        {"people": 0},
        {"frames": 900, "people": 12, "moved": 3.0, "ids": lambda frame: np.arange(12) + frame // 30},
    ],
)
def test_plots_are_svg_in_the_colours_of_the_page(draw, case):
    svg = draw("x", identities_of(*made(**case)))
    assert ET.fromstring(svg.replace("xlink:", "")).tag.endswith("svg")
    assert "#0102" not in svg
    assert "#ffffff" not in svg
    assert "nan" not in svg
    assert len(svg) < 400_000
    assert svg == draw("x", identities_of(*made(**case)))


def test_colours_of_two_dozen_identities_differ():
    colors = [identity_color(index) for index in range(24)]
    assert len(set(colors)) == 24
    assert colors[:8] == [line_color(index) for index in range(8)]
    assert identity_color(24) == colors[0]


def test_runs_of_equal_values():
    assert list(runs_of(np.array([1, 1, 0, 2, 2]))) == [(0, 2), (2, 3), (3, 5)]
    assert list(runs_of(np.zeros(0))) == []


@pytest.mark.slow
def test_the_page_shows_identities_of_variants_that_have_them():
    record = make_record()
    assert "People through time" not in render(record)
    tracked = tuple(replace(each, ids=np.arange(len(each))) for each in record.estimates["full"])
    truth = np.stack([true.joints for true in record.truth])
    scores = record.summary["variants"]["full"]
    variants = {
        name: scores | {"tracking": tracking_summary(truth, estimates, record.time)}
        for name, estimates in (("full", record.estimates["full"]), ("track", tracked))
    }
    page = render(
        replace(
            record,
            estimates={"full": record.estimates["full"], "track": tracked},
            scores=record.scores,
            summary=record.summary | {"variants": variants},
        )
    )
    section = re.search(r"<h2>People through time</h2>.*?</section>", page, re.S)[0]
    assert section.count("<svg") == 2
    assert "Identities, track" in section
    assert "Identities, full" not in section
    idf1 = 100 * variants["track"]["tracking"]["mean_joint"]["0.5"]["idf1"]
    assert f"<td>{idf1:.1f}</td>" in section
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
