"""Published tables: consistent averages, and the numbers of the paper's source."""

import re

import pytest

from mvpose.presets import PRESETS
from simharness.reality.evaluation import ABLATION
from tools.paper_tables.tables import COMPARISON

ROWS = [
    (data, name, row) for table in (ABLATION, COMPARISON) for data, rows in table.items() for name, row in rows.items()
]
INCONSISTENT = ("campus", "Belagiannis et al., CVPR 2014")  # in the paper: the mean of the row is 76.03, printed 75.8


def within_rounding(row):
    """Return whether the average agrees with the mean of the three actors; rounding explains up to 0.1."""
    return abs(sum(row[:3]) / 3 - row.average) <= 0.1 + 1e-9


@pytest.mark.parametrize(("data", "name", "row"), ROWS)
def test_averages_are_the_means_of_the_actors(data, name, row):
    assert within_rounding(row) is ((data, name) != INCONSISTENT)


def test_both_data_sets_have_all_rows():
    assert ABLATION.keys() == COMPARISON.keys() == {"campus", "shelf"}
    assert {len(rows) for rows in COMPARISON.values()} == {6}
    for rows in ABLATION.values():
        assert list(rows) == ["full", "appearance", "geometry", "no-3dps", "no-matching"]
        assert rows.keys() <= PRESETS.keys()


@pytest.mark.parametrize(("label", "table"), [("tb:ablative", ABLATION), ("tb:state-of-the-art", COMPARISON)])
def test_the_numbers_are_those_of_the_papers_source(shared_data, label, table):
    paper = shared_data.parent / "paper" / "dong2019.tex"
    if not paper.is_file():
        pytest.skip(f"no source of the paper: {paper.name}")
    (source,) = (each for each in paper.read_text().split(r"\begin{table}") if rf"\label{{{label}}}" in each)
    body = source[: source.index(r"\end{tabular}")]
    printed = [
        tuple(float(number) for number in re.findall(r"&\s*(?:{\\bf )?(\d+\.\d)", line))
        for line in body.splitlines()
        if re.search(r"\d\.\d", line)
    ]
    assert printed == [row for data in ("campus", "shelf") for row in table[data].values()]
