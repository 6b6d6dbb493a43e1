"""Digest of a study: its numbers, its provenance, and a standalone picture of its curves."""

import json
import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import polars as pl
import pytest
from made_study import make_study, pcp_of

from mvpose.report.svg_plots import plot_sheet
from simharness.scoring.catalogue import SCORES
from simharness.scoring.failure_classes import FailureKind
from simharness.scoring.stage_blame import Stage
from simharness.study.study_folder import Tables, write_study
from simharness.trial.identity import PROVENANCE
from tools.study_digest.__main__ import main
from tools.study_digest.digest import PRINTED, curves, digest, markdown, write_digest

SVG = "{http://www.w3.org/2000/svg}"
COUNTS = [2, 3, 5]


@pytest.fixture
def study(tmp_path):
    return make_study(tmp_path, factors={"cameras.count": COUNTS}, slope=10.0)


def test_means_are_those_of_the_trials(study):
    numbers = digest(study)
    for variant in ("full", "fast"):
        at = [[pcp_of(variant, {"cameras.count": n}, seed, 10.0) for seed in range(4)] for n in COUNTS]
        mean, low, high = numbers["means"][variant]["pcp"]
        assert mean == pytest.approx(np.mean(at), abs=1e-4)
        assert low <= mean <= high
        (factor,) = numbers["factors"]
        assert factor["values"] == COUNTS
        assert [ends[0] for ends in factor["scores"][variant]["pcp"]] == pytest.approx(np.mean(at, axis=1), abs=1e-4)


def test_a_digest_has_breaking_points(study):
    full = next(each for each in digest(study)["breaking"] if each["variant"] == "full")
    # The mean of full is 60.375 + 10 n, because 0.5 (seed % 3) is 0.375 on average: 90 at 2.96 cameras.
    assert full["value"] == pytest.approx(2.9625, abs=1e-3)
    assert full["worse_when"] == "less"
    assert full["low"] <= full["value"] <= full["high"]


def test_every_failure_has_a_kind_and_a_stage(study):
    numbers = digest(study)["failures"]
    for variant, failed in numbers.items():
        failures = study.failures.filter(study.failures["variant"] == variant)
        frames = len(study.frames.filter(study.frames["variant"] == variant))
        assert len(failures) > 0
        for column in ("kinds", "stages"):
            assert sum(failed[column].values()) == pytest.approx(100 * len(failures) / frames, abs=0.01)
        alone = [each for each in failures["matching_alone"].to_list() if each is not None]
        assert failed["matching_alone"] == pytest.approx(100 * sum(alone) / len(alone), abs=0.05)
        assert 0 < failed["matching_alone"] < 100
        assert failed["kinds"].keys() <= {*map(str, FailureKind)}
        assert failed["stages"].keys() <= {*map(str, Stage)}


def test_the_stage_method_is_listed_only_for_user_defined_estimators(study):
    def stages(numbers):
        return re.findall(r"^\| by (\w+) \|", markdown(numbers), re.MULTILINE)

    assert stages(digest(study)) == ["detection", "matching", "reconstruction"]
    blamed = study.failures["stage"].replace({"matching": "method"})
    numbers = digest(replace(study, failures=study.failures.with_columns(blamed)))
    assert stages(numbers) == ["detection", "matching", "reconstruction", "method"]
    assert numbers["failures"]["full"]["stages"]["method"] > 0


def test_failures_have_intervals_over_seeds(study):
    numbers = digest(study)["failures"]
    for failed in numbers.values():
        ends = failed["intervals"]
        rates = [(failed[column][key], *ends[column][key]) for column in ("kinds", "stages") for key in failed[column]]
        for rate, low, high in [*rates, (failed["matching_alone"], *ends["matching_alone"])]:
            assert 0 <= low <= rate <= high
        assert any(low < high for _, low, high in rates)
        assert ends["matching_alone"][1] <= 100
    alone = replace(study, **{name: study_of_seed(study, name, 0) for name in ("trials", "frames", "failures")})
    (ends,) = {str(end) for each in digest(alone)["failures"].values() for end in each["intervals"]["kinds"].values()}
    assert ends == "[None, None]"


def study_of_seed(study, name, seed):
    """Return the rows of one seed of a table of a study."""
    trials = study.trials.filter(pl.col("seed") == seed)["trial"].unique()
    return getattr(study, name).filter(pl.col("trial").is_in(trials.implode()))


def test_seeds_with_the_same_failures_have_an_interval_of_no_width(study):
    failures = study.failures.clear().vstack(
        pl.DataFrame(
            [
                {"trial": trial, "variant": "full", "frame": 0, "person": 0, "kind": "missed", "stage": "matching"}
                | {"matching_alone": True, "joints": [], "error_mm": None}
                for trial in study.trials["trial"].unique()
            ],
            schema=study.failures.schema,
        )
    )
    full = digest(replace(study, failures=failures))["failures"]["full"]
    assert full["kinds"] == {"missed": 20.0}  # one in the five frames of each trial
    assert full["intervals"] == {
        "kinds": {"missed": [20.0, 20.0]},
        "stages": {"matching": [20.0, 20.0]},
        "matching_alone": [full["intervals"]["matching_alone"][0], 100.0],
    }
    # Four seeds that agree do not exclude a fifth one with another event.
    assert full["intervals"]["matching_alone"][0] == pytest.approx(100 + 25 * math.log(0.025) / 4, abs=0.1)


def test_the_text_explains_its_terms(study):
    text = markdown(digest(study))
    for table in (text.split("## Failures")[1], text.split("## Breaking points")[1].split("## ")[0]):
        cells = set(re.findall(r"\| (?:by )?([a-z][a-z ]*?) (?=\|)", table)) - {"failures", "factor", "broken", "full"}
        explained = set(re.findall(r"\*([a-z ]+)\*:", table))
        assert cells - {"fast"} <= explained
        assert explained
    for kind in [*map(str, FailureKind)]:
        assert SCORES[f"failures_{kind}"].about in text


def test_the_table_in_the_form_of_papers_has_the_first_variants_means(study):
    numbers = digest(study)
    block = markdown(numbers).split("`full`, all scores, against `cameras.count`:\n\n")[1].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines() if "--" not in line]
    assert rows[0][1:7] == [f"AP {limit}, %" for limit in (25, 50, 75, 100, 125, 150)]
    assert [row[0] for row in rows[1:]] == [str(count) for count in COUNTS]
    pcp = rows[0].index("PCP, %")
    assert [float(row[pcp].split()[0]) for row in rows[1:]] == pytest.approx(
        [np.mean([pcp_of("full", {"cameras.count": n}, seed, 10.0) for seed in range(4)]) for n in COUNTS], abs=0.05
    )
    (factor,) = numbers["factors"]
    for number, row in enumerate(rows[1:]):
        for key, cell in zip(PRINTED, row[1:], strict=True):
            _, *ends = factor["scores"]["full"][key][number]
            low, high = (f"{end:.{SCORES[key].digits}f}" for end in ends)
            assert cell.endswith(f"({low} to {high})")


@pytest.mark.parametrize("score", ["pcp", "map", "ghosts"])
def test_every_variant_has_its_score_at_every_value(study, score):
    numbers = digest(study)
    title = f"{SCORES[score].title}, {SCORES[score].unit}, against `cameras.count`:\n\n"
    block = markdown(numbers).split(title)[1].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()]
    assert rows[0] == ["cameras.count", "full", "fast"]
    (factor,) = numbers["factors"]
    for column, variant in enumerate(("full", "fast"), 1):
        means = [ends[0] for ends in factor["scores"][variant][score]]
        assert [float(row[column].split()[0]) for row in rows[2:]] == pytest.approx(means, abs=0.051)


def test_a_digest_has_its_provenance(study):
    numbers = digest(study)
    assert numbers["command"] == study.info["command"]
    assert all(numbers[key] == study.info[key] for key in PROVENANCE if key != "seconds")
    assert numbers["seconds"] > 0
    assert numbers["seconds"] == pytest.approx(study.trials["seconds"].sum(), abs=0.1)
    text = markdown(numbers)
    assert study.info["command"] in text
    assert all(f"{name} {version}" in text for name, version in study.info["versions"].items())
    assert all(digest[:8] in text for digest in study.info["digests"].values())


def test_a_table_has_as_many_cells_as_headings(tmp_path):
    numbers = digest(make_study(tmp_path, factors={"cameras.count": COUNTS, "people.count": [1, 4]}, cases=("a", "b")))
    tables = [
        [line for line in block.splitlines() if line.startswith("|")] for block in markdown(numbers).split("\n\n")
    ]
    tables = [table for table in tables if table]
    assert len(tables) == 3 + 2 * 2 * 4 + 1 + 1  # all and two cases, two factors in each, breaking points, failures
    for table in tables:
        assert len(table) > 2
        assert len({line.count("|") for line in table}) == 1


@pytest.mark.slow
def test_the_picture_is_one_document_with_every_plot_inside(tmp_path):
    study = make_study(tmp_path, factors={"cameras.count": COUNTS, "people.count": [1, 4]})
    drawn = curves(study)
    assert "currentColor" not in drawn
    assert "var(--" not in drawn
    root = ElementTree.fromstring(drawn)
    places = [
        tuple(float(plot.get(key)) for key in ("x", "y", "width", "height")) for plot in root.findall(SVG + "svg")
    ]
    assert len(places) == 2 * 4
    *_, wide, high = map(float, root.get("viewBox").split())
    for number, (x, y, width, height) in enumerate(places):
        assert 0 <= x < x + width <= wide
        assert 0 <= y < y + height <= high
        for u, v, w, h in places[:number]:
            assert x >= u + w or u >= x + width or y >= v + h or v >= y + height


@pytest.fixture
def cases(tmp_path):
    """Study of two cases; the second has 5 points of PCP and 90 points of precision more."""
    study = make_study(tmp_path, factors={"cameras.count": COUNTS, "people.count": [1, 4]}, cases=("poor", "good"))
    more = pl.when(pl.col("case") == "good")
    trials = study.trials.with_columns(
        pcp=more.then(pl.col("pcp") + 5).otherwise(pl.col("pcp")), precision=more.then(95.0).otherwise(5.0)
    )
    return replace(study, trials=trials)


def of_case(study, case):
    """Return the trials of one case as a study without cases."""
    trials = study.trials.filter(pl.col("case") == case)
    kept = {name: getattr(study, name) for name in ("frames", "people", "failures")}
    kept = {name: rows.filter(pl.col("trial").is_in(trials["trial"].implode())) for name, rows in kept.items()}
    return replace(study, trials=trials.with_columns(case=pl.lit("")), **kept)


@pytest.mark.slow
def test_each_case_breaks_by_itself(cases):
    numbers = digest(cases)
    assert list(numbers["by_case"]) == ["poor", "good"]
    for case, part in numbers["by_case"].items():
        alone = digest(of_case(cases, case))
        assert part == {"factors": alone["factors"], "breaking": alone["breaking"]}
    poor, good = (
        next(
            each["value"] for each in part["breaking"] if (each["factor"], each["variant"]) == ("cameras.count", "full")
        )
        for part in numbers["by_case"].values()
    )
    assert (poor, good) == pytest.approx((3.425, 2.425))  # 60.375 + 5 (n + 2.5) is 90, and 85
    rows = [line for line in markdown(numbers).splitlines() if line.startswith("| `cameras.count` |")]
    assert [row.split("|")[2].strip() for row in rows] == ["poor", "poor", "good", "good"]  # PCP and precision
    for (row, *_), value in zip((rows[:2], rows[2:]), (poor, good), strict=True):
        assert f"below {value:.3g} (" in row
    assert digest(of_case(cases, "good"))["by_case"] == {}


@pytest.mark.slow
def test_a_mean_over_cases_or_other_keys_is_labelled(cases):
    numbers = digest(cases)
    pooled, _ = numbers["factors"]
    assert pooled["over"] == {"people.count": [1, 4], "case": ["poor", "good"]}
    for part in numbers["by_case"].values():
        assert [factor["over"] for factor in part["factors"]] == [{"people.count": [1, 4]}, {"cameras.count": COUNTS}]
    drawn, text = curves(cases), markdown(numbers)
    for note in ("mean over people.count 1, 4", "mean over cameras.count 2, 3, 5"):
        assert drawn.count(f">{note}<") == 2 * 4  # cases and scores
        assert text.count(note) == 2 * 4  # cases and tables
    assert "over case" not in text


@pytest.mark.slow
def test_every_case_has_its_panels_on_one_scale(cases):
    drawn = ElementTree.fromstring(curves(cases))
    panels = drawn.findall(SVG + "svg")
    assert len(panels) == 2 * 2 * 4
    for left, right in zip(panels[::2], panels[1::2], strict=True):
        assert left.get("y") == right.get("y")
        texts = [[text.text for text in panel.iter(SVG + "text")] for panel in (left, right)]
        assert ("poor" in texts[0], "good" in texts[0], "poor" in texts[1], "good" in texts[1]) == (1, 0, 0, 1)
        one, other = (sorted(set(each) - {"poor", "good"}) for each in texts)
        assert one == other  # the same ticks on both axes, and the same words


@pytest.mark.slow
def test_many_cases_stand_in_few_even_rows(tmp_path):
    study = make_study(tmp_path, factors={"cameras.count": COUNTS}, cases=("a", "b", "c", "d"))
    panels = ElementTree.fromstring(curves(study)).findall(SVG + "svg")
    tops = [panel.get("y") for panel in panels]
    assert [tops.count(top) for top in dict.fromkeys(tops)] == [2] * 2 * 4


def test_ghosts_break_precision_where_they_cannot_break_pcp(tmp_path):
    study = make_study(tmp_path, factors={"detector.phantoms.rate": [0.0, 1.0, 2.0]}, slope=0.0)
    ghostly = study.trials.with_columns(pcp=99.0, precision=100 - 8 * pl.col("detector.phantoms.rate"))
    points = {(each["variant"], each["score"]): each for each in digest(replace(study, trials=ghostly))["breaking"]}
    assert points["full", "pcp"]["why"] == "never"
    assert points["full", "precision"]["value"] == pytest.approx(1.25)
    assert points["full", "precision"]["worse_when"] == "greater"


def test_a_plot_without_a_size_is_refused():
    with pytest.raises(ValueError, match="viewBox"):
        plot_sheet([["<svg></svg>"]])


class TestFiles:
    """Files of a digest."""

    @pytest.mark.slow
    def test_a_digest_replaces_an_older_one_and_nothing_else(self, study, tmp_path):
        folder = tmp_path / "kept"
        for _ in range(2):
            write_digest(study, folder)
        assert sorted(file.name for file in folder.iterdir()) == ["curves.svg", "digest.json", "table.md"]
        assert json.loads((folder / "digest.json").read_text()) == digest(study)
        other = tmp_path / "other"
        other.mkdir()
        (other / "thesis.txt").touch()
        with pytest.raises(ValueError, match="holds no digest"):
            write_digest(study, other)
        assert [file.name for file in other.iterdir()] == ["thesis.txt"]

    def test_a_study_with_failed_trials_has_no_digest(self, tmp_path):
        failed = ({"case": "", "factors": {"cameras.count": 2}, "seed": 0, "error": "no room"},)
        study = make_study(tmp_path, factors={"cameras.count": COUNTS}, failed=failed)
        with pytest.raises(ValueError, match="1 trials failed"):
            write_digest(study, tmp_path / "kept")
        assert not (tmp_path / "kept").exists()


def test_scores_over_time_are_there_where_a_variant_tracks_people(study, tmp_path):
    tracked = make_study(tmp_path, factors={"cameras.count": COUNTS}, variants=("full", "track"))
    numbers, plain = digest(tracked), digest(study)
    for key in ("hota", "idf1", "pcp_tracked", "switches_per_minute"):
        assert numbers["means"]["track"][key][0] == pytest.approx(1.5, abs=0.5)
        assert numbers["means"]["full"][key] is None
        assert numbers["factors"][0]["scores"]["full"][key] == [None] * 3
        assert key not in plain["means"]["full"]
    text = markdown(numbers)
    assert "| variant | HOTA, % | AssA, % |" in text
    assert "HOTA, %, against `cameras.count`:" in text
    assert "HOTA" not in markdown(plain)


@pytest.mark.slow
def test_the_command(study, tmp_path, capsys):
    (tmp_path / "study").mkdir()
    write_study(tmp_path / "study", study.info, Tables(study.trials, study.frames, study.people, study.failures), "")
    assert main([str(tmp_path / "study"), str(tmp_path / "kept")]) == 0
    assert json.loads((tmp_path / "kept" / "digest.json").read_text()) == digest(study)
    assert main([str(tmp_path), str(tmp_path / "other")]) == 2
    assert "not the result folder of a study" in capsys.readouterr().err
