"""What is kept of a study beside the code: right numbers, where they come from, and a picture that stands by itself."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from made_study import make_study, pcp_of
from typer.testing import CliRunner

from simharness.cli import app
from simharness.report.digest import curves, digest, markdown, write_digest
from simharness.report.sheet import sheet
from simharness.report.study_plots import BLAME_COLORS, KIND_COLORS
from simharness.study.provenance import PROVENANCE

SVG = "{http://www.w3.org/2000/svg}"
COUNTS = [2, 3, 5]


@pytest.fixture
def study(tmp_path):
    return make_study(tmp_path, factors={"cameras.count": COUNTS}, slope=10.0)


def test_means_are_those_of_the_trials(study):
    told = digest(study)
    for variant in ("full", "fast"):
        at = [[pcp_of(variant, {"cameras.count": n}, seed, 10.0) for seed in range(4)] for n in COUNTS]
        mean, low, high = told["means"][variant]["pcp"]
        assert mean == pytest.approx(np.mean(at), abs=1e-4)
        assert low <= mean <= high
        (factor,) = told["factors"]
        assert factor["values"] == COUNTS
        assert [ends[0] for ends in factor["scores"][variant]["pcp"]] == pytest.approx(np.mean(at, axis=1), abs=1e-4)


def test_it_says_where_it_breaks(study):
    full = next(each for each in digest(study)["breaking"] if each["variant"] == "full")
    # The mean of full is 60.375 + 10 n, for 0.5 (seed % 3) is 0.375 on average: 90 at 2.96 cameras.
    assert full["value"] == pytest.approx(2.9625, abs=1e-3)
    assert full["worse_when"] == "less"
    assert full["low"] <= full["value"] <= full["high"]


def test_every_failure_has_a_kind_and_a_stage(study):
    told = digest(study)["failures"]
    for variant, failed in told.items():
        mine = study.failures.filter(study.failures["variant"] == variant)
        frames = len(study.frames.filter(study.frames["variant"] == variant))
        assert len(mine) > 0
        for column in ("kinds", "stages"):
            assert sum(failed[column].values()) == pytest.approx(100 * len(mine) / frames, abs=0.01)
        alone = [each for each in mine["matching_alone"].to_list() if each is not None]
        assert failed["matching_alone"] == pytest.approx(100 * sum(alone) / len(alone), abs=0.05)
        assert 0 < failed["matching_alone"] < 100
        assert failed["kinds"].keys() <= KIND_COLORS.keys()
        assert failed["stages"].keys() <= BLAME_COLORS.keys()


def test_a_whole_method_is_to_blame_only_where_one_from_elsewhere_is(study):
    assert "| by reconstruction | matching alone |" in markdown(digest(study))
    stages = study.failures["stage"].replace({"matching": "method"})
    told = digest(replace(study, failures=study.failures.with_columns(stages)))
    assert "| by reconstruction | by method | matching alone |" in markdown(told)
    assert told["failures"]["full"]["stages"]["method"] > 0


def test_the_table_in_the_form_of_papers_has_the_first_variants_means(study):
    told = digest(study)
    block = markdown(told).split("`full`, all scores, against `cameras.count`:\n\n")[1].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines() if "--" not in line]
    assert rows[0][1:7] == [f"AP {limit}, %" for limit in (25, 50, 75, 100, 125, 150)]
    assert [row[0] for row in rows[1:]] == [str(count) for count in COUNTS]
    pcp = rows[0].index("PCP, %")
    assert [float(row[pcp]) for row in rows[1:]] == pytest.approx(
        [np.mean([pcp_of("full", {"cameras.count": n}, seed, 10.0) for seed in range(4)]) for n in COUNTS], abs=0.05
    )


def test_it_says_where_it_comes_from(study):
    told = digest(study)
    assert told["command"] == study.info["command"]
    assert all(told[key] == study.info[key] for key in PROVENANCE if key != "seconds")
    assert told["seconds"] > 0
    assert told["seconds"] == pytest.approx(study.trials["seconds"].sum(), abs=0.1)
    text = markdown(told)
    assert study.info["command"] in text
    assert all(f"{name} {version}" in text for name, version in study.info["versions"].items())
    assert all(digest[:8] in text for digest in study.info["digests"].values())


def test_a_table_has_as_many_cells_as_headings(tmp_path):
    told = digest(make_study(tmp_path, factors={"cameras.count": COUNTS, "people.count": [1, 4]}, cases=("a", "b")))
    tables = [[line for line in block.splitlines() if line.startswith("|")] for block in markdown(told).split("\n\n")]
    tables = [table for table in tables if table]
    assert len(tables) == 3 + 2 * 2 + 1 + 1  # all and two cases, two factors twice, breaking points, failures
    for table in tables:
        assert len(table) > 2
        assert len({line.count("|") for line in table}) == 1


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


def test_what_has_no_size_is_refused():
    with pytest.raises(ValueError, match="viewBox"):
        sheet([["<svg></svg>"]])


class TestFiles:
    """On disk."""

    def test_a_digest_replaces_an_older_one_and_nothing_else(self, study, tmp_path):
        folder = tmp_path / "kept"
        for _ in range(2):
            write_digest(study, folder)
        assert sorted(file.name for file in folder.iterdir()) == ["curves.svg", "digest.json", "table.md"]
        assert json.loads((folder / "digest.json").read_text()) == digest(study)
        mine = tmp_path / "mine"
        mine.mkdir()
        (mine / "thesis.txt").touch()
        with pytest.raises(ValueError, match="holds no digest"):
            write_digest(study, mine)
        assert [file.name for file in mine.iterdir()] == ["thesis.txt"]

    def test_a_study_that_is_not_whole_has_none(self, tmp_path):
        failed = ({"case": "", "factors": {"cameras.count": 2}, "seed": 0, "error": "no room"},)
        study = make_study(tmp_path, factors={"cameras.count": COUNTS}, failed=failed)
        with pytest.raises(ValueError, match="1 trials failed"):
            write_digest(study, tmp_path / "kept")
        assert not (tmp_path / "kept").exists()

    def test_page_recording_and_digest_are_asked_for_one_by_one(self, tmp_path):
        result = CliRunner().invoke(app, ["report", str(tmp_path), "--digest", "a", "--rerun", "b"])
        assert result.exit_code == 2
        assert "--rerun and --digest" in result.stderr
