"""Page of a study: its numbers, its structure, and its messages on failed trials."""

import dataclasses
import re
import shlex
from html.parser import HTMLParser

import numpy as np
import polars as pl
import pytest
from made_study import make_study, pcp_of
from typer.testing import CliRunner

from simharness.cli import app
from simharness.outputs.study.page import render_study, write_report
from simharness.outputs.study.worst_frames import worst_frames
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import Interval
from simharness.study.causes.blame_text import FILE, read_blame, write_blame
from simharness.study.causes.cause_shares import Blame, Mending, Share

GRID = {"cameras.count": [2, 3, 5], "detector.profile": ["poor", "good"]}
_VOID = {"meta", "input", "img", "br"}


class Reader(HTMLParser):
    """Parser that collects tags with their attributes, and checks that all are closed in order."""

    def __init__(self, page):
        super().__init__()
        self.tags, self._open = [], []
        self.feed(page)
        assert not self._open

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in _VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def all(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return render_study(make_study(tmp_path_factory.mktemp("page"), factors=GRID, cases=("crowd", "empty")))


@pytest.fixture(scope="module")
def page_of_grid(tmp_path_factory):
    return render_study(make_study(tmp_path_factory.mktemp("page"), factors=GRID))


def cells_of(page, row):
    """Return the first line of every cell of the first table row with this heading."""
    found = re.search(rf'<tr[^>]*><th scope="row">{row}</th>(.*?)</tr>', page, re.DOTALL)
    return re.findall(r"<td[^>]*>([^<]*)", found.group(1))


@pytest.mark.slow
def test_the_headline_is_the_mean_over_everything(tmp_path):
    page = render_study(make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}))
    for variant in ("full", "fast"):
        expected = np.mean([pcp_of(variant, {"cameras.count": n}, seed) for n in (2, 3, 5) for seed in range(4)])
        assert cells_of(page, variant)[0] == f"{expected:.1f}"


@pytest.mark.slow
def test_figures_are_the_plots_of_the_page_and_the_points_of_its_curves(tmp_path):
    results = make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}, cases=("crowd", "empty"))
    results = dataclasses.replace(results, failures=results.failures.clear())  # no frame is shown
    page = write_report(results, figures=tmp_path / "figures").read_text()
    plots = sorted((tmp_path / "figures").glob("*.pdf"))
    assert len(plots) == page.count("<svg") > 8
    assert all(each.read_bytes().startswith(b"%PDF") for each in plots)
    table = pl.read_csv(tmp_path / "figures" / "curves.csv")
    rows = table.filter(score="pcp", factor="cameras.count", case="empty", variant="fast")
    expected = [np.mean([pcp_of("fast", {"cameras.count": n}, seed) for seed in range(4)]) for n in (2, 3, 5)]
    assert rows["value"].to_list() == [2, 3, 5]
    np.testing.assert_allclose(rows["mean"], expected)
    for below, above in (("low", "mean"), ("mean", "high")):
        assert (rows[below] < rows[above]).all()
    assert (rows["seeds"] == 4).all()


@pytest.mark.slow
def test_every_score_that_applies_has_its_mean(tmp_path):
    results = make_study(tmp_path, factors={"cameras.count": [2, 3]}, variants=("full", "track"))
    trials = results.trials.with_columns(pl.lit(None, pl.Float64).alias("phantoms_pruned"))
    results = dataclasses.replace(results, trials=trials)
    page = render_study(results)
    table = page[page.index('class="panel every"') :]
    rows = 0
    for key, info in SCORES.items():
        values = results.trials.filter(pl.col("variant") == "track")[key].drop_nulls()
        title = f"{info.title}, {info.unit}" if info.unit else info.title
        row = re.search(rf'<th scope="row">{re.escape(title)}<span.*?</tr>', table, re.DOTALL)
        assert (row is not None) == bool(len(values))
        if row is not None:
            rows += 1
            assert re.findall(r"<td>([^<]*)", row[0])[1] == f"{values.mean():.{info.digits}f}"
    assert rows == len(SCORES) - 1


@pytest.mark.slow
def test_every_value_of_a_factor_has_its_number(tmp_path):
    page = render_study(make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}))
    for value in (2, 3, 5):
        expected = np.mean([pcp_of("full", {"cameras.count": value}, seed) for seed in range(4)])
        assert cells_of(page, value)[0] == f"{expected:.1f}"


def test_it_is_one_whole_document(page):
    reader = Reader(page)
    headings = [tag for tag, _ in reader.tags if tag in ("h1", "h2", "h3")]
    assert headings[0] == "h1"
    assert headings.count("h1") == 1
    assert all("scope" in cell for cell in reader.all("th"))
    identities = [attributes["id"] for _, attributes in reader.tags if attributes.get("id")]
    assert len(identities) == len(set(identities))
    labels = {attributes["for"] for attributes in reader.all("label") if "for" in attributes}
    assert labels
    assert labels <= set(identities)
    assert "nan" not in re.sub(r"<[^>]*>", " ", page.split("</head>")[1]).lower().split()


@pytest.mark.slow
def test_it_needs_nothing_from_elsewhere(page, shown, ran):
    for text in (page, render_study(ran, shown=[picture for picture, _ in shown])):
        for tag, attributes in Reader(text).tags:
            for name in ("src", "href", "xlink:href", "srcset", "action"):
                assert not attributes.get(name) or attributes[name].startswith(("data:", "#")), (tag, attributes[name])
        assert not re.search(r"@import|url\((?!#)", text)
        assert set(re.findall(r"https?://[^\s\"'<)]*", text)) <= {
            "http://www.w3.org/2000/svg",
            "http://www.w3.org/1999/xlink",
            "http://www.w3.org/1998/Math/MathML",
        }


@pytest.mark.slow
def test_failed_trials_are_listed_before_any_number(tmp_path):
    failed = ({"case": "", "factors": {"cameras.count": 2}, "seed": 9, "error": "RunError: <b>out of memory"},) * 30
    page = render_study(make_study(tmp_path, failed=failed))
    assert page.index('role="alert"') < page.index("<table")
    assert "30 trials failed" in page
    assert page.count("RunError: &lt;b&gt;out of memory") == 20
    assert "and 10 more" in page
    assert "12 of 42" in page
    assert 'role="alert"' not in render_study(make_study(tmp_path))


def test_a_study_of_which_nothing_finished_says_so(tmp_path):
    made = make_study(tmp_path)
    nothing = dataclasses.replace(made, **{name: getattr(made, name).clear() for name in ("trials", "people")})
    empty = pl.DataFrame(schema={"trial": pl.String, "variant": pl.String})  # as a study without results has it
    nothing = dataclasses.replace(nothing, frames=empty, people=empty, failures=empty)
    page = write_report(nothing).read_text(encoding="utf-8")
    assert "No trial of this study finished" in page
    Reader(page)


@pytest.mark.slow
def test_one_seed_has_no_intervals_and_no_tests(tmp_path):
    page = render_study(make_study(tmp_path, seeds=1))
    assert "A single seed has no interval" in page
    assert "<small>" not in page
    assert "Holm" not in page


@pytest.mark.slow
def test_a_variant_that_is_significantly_worse_is_bold(tmp_path):
    page = render_study(make_study(tmp_path, seeds=12))  # p = 2^-12 stays significant after Holm's correction
    row = re.search(r'<th scope="row">fast<small class="note"> − full</small></th>(<td[^>]*>[^<]*)', page).group(1)
    assert row == '<td class="strong">−4.0'


@pytest.mark.slow
def test_the_page_has_breaking_points_of_the_given_thresholds(tmp_path):
    results = make_study(tmp_path)
    assert "PCP under 90 %" in render_study(results)
    page = render_study(results, thresholds={"pcp": 80.0, "ghosts": 1.0})
    assert "PCP under 80 %" in page
    assert "Ghosts over 1 per frame" in page
    assert "below 3.92" in page  # (80 - 60.375) / 5 = 3.925


@pytest.mark.slow
def test_two_factors_of_a_grid_have_heat_maps_and_one_at_a_time_has_none(tmp_path, page, page_of_grid):
    assert page.count("Both factors") == 2 * 2  # cases and variants
    assert page_of_grid.count("Both factors") == 2
    assert "Both factors" not in render_study(make_study(tmp_path, factors=GRID, one_at_a_time=True))


@pytest.mark.slow
def test_every_case_has_a_row_for_each_variant(page, tmp_path):
    for case in ("crowd", "empty"):
        rows = re.search(rf'<th scope="rowgroup" colspan="9">{case}</th></tr>(.*?)</tbody>', page, re.DOTALL).group(1)
        assert re.findall(r'<th scope="row">([^<]*)</th>', rows) == ["full", "fast"]
    assert "<h2>Cases</h2>" not in render_study(make_study(tmp_path))


@pytest.mark.slow
def test_curves_and_breaking_points_are_of_one_case_each(tmp_path, page_of_grid):
    results = make_study(tmp_path, factors=GRID, cases=("crowd", "empty"))
    more = pl.when(pl.col("case") == "empty").then(10.0).otherwise(0.0)
    page = render_study(dataclasses.replace(results, trials=results.trials.with_columns(pcp=pl.col("pcp") + more)))
    figures = re.findall(r"<h3><code>([^<]*)</code>, case (\w+)</h3>\s*<figcaption>([^<]*)</figcaption>", page)
    over = {
        "cameras.count": "Mean over detector.profile poor, good.",
        "detector.profile": "Mean over cameras.count 2, 3, 5.",
    }
    assert figures == [(key, case, over[key]) for key in GRID for case in ("crowd", "empty")]
    breaks = page[page.index("<h2>Breaking points</h2>") :]
    group, rest = re.search(r'colspan="4"><code>([^<]*)</code>(.*?)</tbody>', breaks, re.DOTALL).groups()
    assert group == "cameras.count"
    rows = re.findall(r'<th scope="row">PCP under 90 %</th><td>(\w+)</td><td[^>]*>([^<]*)', rest)
    assert rows == [("crowd", "already at 5"), ("empty", "below 3.92")]  # (90 - 10 - 60.375) / 5
    assert "<td>crowd</td>" not in page_of_grid


@pytest.mark.slow
def test_text_of_the_user_is_escaped(tmp_path):
    page = render_study(make_study(tmp_path, description="<script>alert(1)</script>", command="a <b> & c"))
    assert "<script>alert" not in page
    assert "a &lt;b&gt; &amp; c" in page


def test_the_worst_frames_have_the_highest_cost_and_one_of_each_setting(tmp_path):
    results = make_study(tmp_path, factors={"cameras.count": [2, 3, 4, 5, 6]})
    errors = results.people.filter(pl.col("variant") == "full").group_by("trial", "frame").agg(pl.col("error_mm").sum())
    costs = {}
    for row in (
        results.frames.filter(pl.col("variant") == "full").join(errors, on=["trial", "frame"]).iter_rows(named=True)
    ):
        setting = int(row["trial"], 16) // 4  # four seeds each
        cost = row["error_mm"] + 500 * (row["missed"] + row["ghosts"])
        costs[setting] = max(costs.get(setting, 0.0), cost)
    assert [frame.cost for frame in worst_frames(results)] == pytest.approx(sorted(costs.values(), reverse=True)[:4])


def test_a_study_of_one_setting_shows_the_worst_of_its_trials(tmp_path):
    frames = worst_frames(make_study(tmp_path, factors={}, seeds=12))
    assert len({frame.trial for frame in frames}) == len(frames) == 4
    assert [frame.cost for frame in frames] == sorted((frame.cost for frame in frames), reverse=True)


def test_a_frame_without_a_failure_is_no_worst_frame(tmp_path):
    made = make_study(tmp_path)
    assert worst_frames(dataclasses.replace(made, failures=made.failures.clear())) == []


@pytest.mark.slow
def test_failures_have_their_definition_and_the_worst_kinds_first(tmp_path):
    results = make_study(tmp_path)
    page = render_study(results)
    section = page[page.index("<h2>Failures</h2>") : page.index("<h2>Time per frame</h2>")]
    assert "A failure is one wrong person in one frame, or one ghost" in section
    rows = re.findall(r'<th scope="row">([a-z ]+)<span class="meaning">.*?<span>([\d.]+)</span>', section)
    assert [kind for kind, _ in rows] == ["missed", "ghost", "merged", "split", "displaced joint"]
    full = results.failures.filter((pl.col("variant") == "full") & (pl.col("kind") == "missed"))
    frames = len(results.frames.filter(pl.col("variant") == "full"))
    assert float(dict(rows)["missed"]) == pytest.approx(100 * len(full) / frames, abs=0.05)


@pytest.mark.slow
def test_what_cost_the_score_stands_on_the_page(tmp_path):
    results = make_study(tmp_path)
    assert "--blame 10</pre>" in render_study(results)
    number = Interval(4.0, 1.0, 9.0, 5)
    found = Blame(
        scenario="made",
        setting="cameras.count 2",
        variant="full",
        score="pcp",
        seeds=(0, 1, 2, 3, 4),
        before=Interval(90.0, 80.0, 95.0, 5),
        after=Interval(98.0, 97.0, 99.0, 5),
        rest=Interval(2.0, 1.0, 3.0, 5),
        shares=(Share("boxes", number, number, number), Share("swaps", number, number, number)),
        mending=Mending(("boxes", "swaps"), Interval(98.0, 97.0, 99.0, 5), Interval(8.0, 2.0, 14.0, 5), 1.0),
        absent=("clocks",),
    )
    write_blame(found, tmp_path)
    assert read_blame(tmp_path) == found
    page = render_study(results, found=found)
    assert "Mend first: missed and merged boxes, inversions and swaps. PCP is then 98.0 % (97.0 to 99.0): 100 %" in page
    assert "Not in this setting: clocks." in page
    assert page.count("<circle") == 2
    (tmp_path / FILE).write_text("{}")
    with pytest.raises(ValueError, match="write it again with --blame"):
        read_blame(tmp_path)


def test_the_frames_shown_are_those_that_were_scored(ran, shown):
    """The trials are run again: the error of every person is the one in the tables."""
    assert len(shown) == 4
    for picture, again in shown:
        rows = ran.people.filter((pl.col("trial") == picture.trial) & (pl.col("variant") == "full"))
        assert len(rows) == len(again.time) * 2
        for row in rows.iter_rows(named=True):
            frame, owners = row["frame"], again.owners(row["frame"])
            estimate = np.flatnonzero(owners == row["person"])
            assert row["found"] == bool(len(estimate))
            if len(estimate):
                offset = again.estimates[frame].joints[estimate[0]] - again.truth[frame].joints[row["person"]]
                assert 1000 * np.nanmean(np.linalg.norm(offset, axis=-1)) == pytest.approx(row["error_mm"], rel=1e-6)


def test_the_command_of_a_worst_frame_is_its_trial(ran, shown):
    from simharness.scenario.load import load

    for picture, again in shown:
        words = shlex.split(picture.command)
        sets = [words[k + 1] for k, word in enumerate(words) if word == "--set"]
        scenario = load(ran.folder / "study.toml", overrides=sets, seed=int(words[words.index("--seed") + 1]))
        assert scenario == ran.scenario_of(picture.trial)
        assert again.trial.scenario.cameras.count == scenario.cameras.count


class TestCommand:
    def call(self, *arguments):
        return CliRunner().invoke(app, ["report", *map(str, arguments)], catch_exceptions=False)

    def refused(self, *arguments):
        result = self.call(*arguments)
        assert result.exit_code == 2
        assert "Traceback" not in result.stderr
        return result.stderr

    @pytest.mark.slow
    def test_it_writes_the_page(self, ran):
        result = self.call(ran.folder)
        assert result.exit_code == 0
        page = (ran.folder / "report.html").read_text(encoding="utf-8")
        assert page.count('class="view-3d"') == 4
        assert not list(ran.folder.glob(".*partial"))

    def test_a_folder_that_is_no_study(self, tmp_path):
        assert "not the result folder of a study" in self.refused(tmp_path)

    def test_a_threshold_that_is_none(self, ran):
        assert "expected SCORE=NUMBER" in self.refused(ran.folder, "--threshold", "pcp")
        assert "no such score" in self.refused(ran.folder, "--threshold", "pxp=90")

    def test_a_place_that_cannot_be_written_to(self, ran, tmp_path):
        (tmp_path / "file").write_text("not a folder")
        assert "cannot be written" in self.refused(ran.folder, "--out", tmp_path / "file" / "page.html")

    def test_the_folder_of_a_run(self, tmp_path):
        for name in ("summary.json", "estimates.npz"):
            (tmp_path / name).touch()
        assert f"whose report is {tmp_path / 'report.html'}" in self.refused(tmp_path)


@pytest.mark.slow
def test_a_variant_that_tracks_people_has_curves_over_time(tmp_path, page_of_grid):
    """Other variants have no line there, and heat maps without numbers; studies without such a variant have no tab."""
    page = render_study(make_study(tmp_path, factors=GRID, variants=("full", "track")))
    for key in ("hota", "idf1", "switches_per_minute", "jerk_ratio"):
        assert f'id="tab-{key}"' in page
        assert page.count(f'class="of of-{key}"') == 2 * 2 + 2  # plots and numbers of two factors, two heat maps
    assert 'id="tab-hota"' not in page_of_grid
