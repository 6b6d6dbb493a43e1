"""Plots: colours of the page, unique ids, and empty data."""

import itertools
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from mvpose.report.palette import line_color
from mvpose.report.svg_plots import STAGE_COLORS
from simharness.outputs.run import plots
from simharness.outputs.study import plots as study_plots
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import Interval
from simharness.world.rigs.layouts import build_rig


def draw_all(people: int = 3, frames: int = 6) -> list[str]:
    rng = np.random.default_rng(0)
    errors = rng.uniform(10, 40, (frames, people))
    errors[1:3] = np.nan
    shares = np.full((5, 5), 0.2)
    return [
        plots.error_over_time(np.arange(frames) / 10, errors, np.ones(errors.shape, bool)),
        plots.error_distribution({"full": errors.ravel(), "no-3dps": errors.ravel() * 2}),
        plots.visibility_shares([f"cam{k}" for k in range(5)], shares, labels=list("abcde")),
        plots.stage_times({"full": {"affinity": 1.0, "matching": 2.0, "total": 3.1}, "other": {"affinity": 4.0}}),
        plots.floor_plan(
            build_rig(CamerasSection()),
            (8.0, 8.0),
            things=[np.array([[0, 0], [1, 0], [1, 1.0]])],
            paths=rng.normal(size=(frames, people, 2)),
            estimates=rng.normal(size=(people, 2)),
        ),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("frames", [1, 6])
@pytest.mark.parametrize("people", [1, 3])
def test_every_plot_is_one_svg_element_in_the_colours_of_the_page(people, frames):
    for svg in draw_all(people, frames):
        assert ET.fromstring(svg.replace("xlink:", "")).tag.endswith("svg")
        assert "currentColor" in svg
        assert "var(--faint)" in svg
        assert "#0102" not in svg, "a placeholder colour was left"
        assert "#ffffff" not in svg, "a white background is wrong on a dark page"
        assert not re.match(r"<svg[^>]* width=", svg), "the page sets the width"


@pytest.mark.slow
def test_plots_on_one_page_share_no_ids():
    ids = [name for svg in draw_all() for name in re.findall(r'\bid="([^"]+)"', svg)]
    assert len(ids) == len(set(ids))


def test_every_reference_has_its_target():
    for svg in draw_all():
        targets = set(re.findall(r'\bid="([^"]+)"', svg))
        references = set(re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', svg))
        assert {a or b for a, b in references} <= targets


@pytest.mark.slow
def test_plots_are_the_same_every_time():
    assert draw_all() == draw_all()


def test_a_method_without_stages_has_the_stage_method():
    svg = plots.stage_times({"custom": {"total": 7.0}, "full": {"affinity": 1.0, "matching": 2.0, "total": 3.0}})
    assert svg.count("7.0 ms") == svg.count("3.0 ms") == 1
    colors = [STAGE_COLORS[stage] for stage in ("affinity", "matching", "method")]
    assert all(color in svg for color in colors)
    assert STAGE_COLORS["method"] not in plots.stage_times({"full": {"affinity": 1.0, "total": 1.0}})


def test_only_people_who_are_there_are_marked_as_not_found():
    errors = np.array([[20.0, 30.0], [20.0, np.nan], [20.0, np.nan]])
    everywhere, once = np.ones((3, 2), bool), np.array([[True, True], [True, True], [True, False]])
    marks = [
        plots.error_over_time(np.arange(3.0), errors, present).count(f"fill: {line_color(1)}")
        for present in (everywhere, once, np.isfinite(errors))
    ]
    assert marks[0] - marks[1] == marks[1] - marks[2] == 1


def test_empty_data_gives_a_plot():
    missed = np.full((4, 2), np.nan)
    assert "<svg" in plots.error_over_time(np.arange(4.0), missed, np.ones((4, 2), bool))
    assert "<svg" in plots.error_distribution({"full": np.zeros(0)})
    assert "<svg" in plots.stage_times({})
    rig = build_rig(CamerasSection())
    empty = {"things": [], "paths": np.zeros((4, 0, 2)), "estimates": np.zeros((0, 2))}
    assert "<svg" in plots.floor_plan(rig, (8, 8), **empty)


@pytest.mark.parametrize(
    "values", [[0, 0.25, 0.5, 1, 2, 4], [0, 0.02, 0.05, 0.1, 0.2, 0.4], [2, 3, 4, 5, 6], [0, 0.001, 1], [5], [3, 3.001]]
)
def test_labels_along_an_axis_do_not_run_into_each_other(values):
    """Labels in the SVG do not overlap; the first label is always drawn, and all labels where there is room."""
    drawn = study_plots.curve(
        "labels",
        factor="faults.rotation",
        values=values,
        numeric=True,
        lines={"full": [Interval(90.0, 80.0, 95.0, 3)] * len(values)},
        score=SCORES["pcp"],
    )
    labels = [f"{value:g}" for value in values]
    written = re.findall(r'text-anchor: middle[^>]* x="([\d.]+)"[^>]*>([\d.]+)</text>', drawn)
    along = [(float(x), text) for x, text in written]
    assert along[0][1] == labels[0]
    assert {text for _, text in along} <= set(labels)
    for (x, text), (beside, other) in itertools.pairwise(along):
        assert beside - x > 5.5 * (len(text) + len(other)) / 2  # a letter of 9 px is 5.5 wide
    if values == list(range(values[0], values[0] + len(values))):
        assert [text for _, text in along] == labels


@pytest.mark.parametrize(
    ("values", "left_out"),
    [([5.0, 10.0, 20.0, 40.0, 60.0, 90.0, 120.0, 180.0], 0), ([1, 2, 4, 8, 16, 32, 64, 128, 256, 512], 0)],
)
def test_ticks_are_the_swept_values(values, left_out):
    """On a logarithmic axis as well, and with many values."""
    drawn = study_plots.curve(
        "ticks",
        factor="cameras.spread",
        values=values,
        numeric=True,
        lines={"full": [Interval(90.0, 80.0, 95.0, 3)] * len(values)},
        score=SCORES["pcp"],
    )
    written = re.findall(r"text-anchor: middle[^>]*>([\d.]+)</text>", drawn)
    assert set(written) <= {f"{value:g}" for value in values}
    assert len(written) == len(values) - left_out


def test_an_axis_has_name_unit_and_key():
    lines = {"full": [Interval(90.0, 80.0, 95.0, 3)] * 2}
    options = {"values": [0.0, 1.0], "numeric": True, "lines": lines, "score": SCORES["pcp"]}
    assert ">error of camera positions, m (faults.translation)<" in study_plots.curve(
        "named", factor="faults.translation", **options
    )
    assert ">detector.correlation.life, s<" in study_plots.curve(
        "unnamed", factor="detector.correlation.life", **options
    )


def test_the_note_on_a_mean_is_short():
    note = study_plots.mean_over(
        {"cameras.count": (2, 4), "cameras.spread": (5.0, 10.0, 20.0, 40.0, 60.0, 90.0, 180.0)}
    )
    assert note == "mean over cameras.count 2, 4 and cameras.spread (5 to 180, 7 values)"
    assert study_plots.mean_over({"detector.profile": tuple("abcdefg")}) == "mean over detector.profile (7 values)"
    assert study_plots.mean_over({}) == ""


def _drawn_curve(lines):
    return study_plots.curve(
        "c", factor="cameras.count", values=(2, 3, 5), numeric=True, lines=lines, score=SCORES["pcp"]
    )


def _heights(svg, color):
    """Return the heights of the points of a line of one colour, from the top of the plot."""
    paths = re.findall(rf'<path d="([^"]*)"[^>]*style="[^"]*stroke: {color}[^"]*stroke-width: 1.7', svg)
    return [float(y) for y in re.findall(r"[ML] [\d.]+ ([\d.]+)", paths[0])]


def test_a_wide_interval_does_not_flatten_the_curve_and_is_marked_where_it_is_cut():
    narrow = [Interval(mean, mean - 1.0, mean + 1.0, 5) for mean in (60.0, 80.0, 95.0)]
    wide = [narrow[0], Interval(80.0, 0.0, 100.0, 5), narrow[2]]
    plain, cut = (_drawn_curve({"full": each, "fast": each, "track": each}) for each in (narrow, wide))
    color = study_plots.VARIANT_COLORS[0]
    span, with_wide = (np.ptp(_heights(svg, color)) for svg in (plain, cut))
    assert with_wide > 0.45 * span  # of the height that the curve has without the wide interval
    marks = [len(re.findall(rf'<use[^>]*style="[^"]*fill: {color}', svg)) for svg in (plain, cut)]
    assert marks == [3, 4]  # a dot for each value, and the arrow at the lower end of the wide interval
