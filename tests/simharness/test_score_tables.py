"""Tables of scores in a terminal: nothing is cut, and identities have a table only where a variant has them."""

from __future__ import annotations

import io
from types import SimpleNamespace

import polars as pl
import pytest
from made_study import make_study
from rich.console import Console

from simharness.cli import run_command, study_command
from simharness.cli.score_tables import ScoreTable


def printed(table, width):
    stream = io.StringIO()
    table.print_to(Console(file=stream, width=width))
    return stream.getvalue()


@pytest.mark.parametrize("width", [40, 80, 200])
@pytest.mark.parametrize("label", ["track", "a_variant_of_a_rather_long_name_that_no_terminal_has_room_for"])
def test_every_cell_is_there_and_no_line_is_wider_than_the_terminal(width, label):
    headings = [f"Heading {n}\nunit {n}" for n in range(9)]
    rows = [(f"{label}_{r}", "0.067", *(f"{r}{n}.5\n{r}{n}.1–\n{r}{n}.9" for n in range(9))) for r in range(3)]
    text = printed(ScoreTable("title", ("variant", "faults.\nclock_offset"), headings, rows), width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    for row in rows:
        for cell in row[2:]:
            assert all(part in text for part in cell.split("\n"))
    assert all(part in text for heading in headings for part in heading.split("\n"))
    assert text.count("title") == len([line for line in text.splitlines() if line.startswith("title")])
    assert ("continued" in text) == (width < 200)


def summary(*, tracking):
    at = {"hota": 0.612, "idf1": 0.738, "id_switches": 3.0, "switches_per_minute": 0.456}
    timings = {"total": {"median": 1.0, "p99": 2.0}}
    return {
        "pcp": 97.5, "precision": 0.9, "recall": 0.8, "mpjpe_mm": {"mean": 40.0, "median": 39.0},
        "ghosts_per_frame": 0.25, "missed_per_frame": 0.5, "matching": {"f1": 0.95}, "timings_ms": timings,
        "tracking": {"mean_joint": {"0.5": at} if tracking else None},
    }  # fmt: skip


def test_a_run_has_identities_where_variants_have_them():
    scores = {"full": summary(tracking=False), "track": summary(tracking=True)}
    given = {"name": "scene", "frames": 10, "seed": 3, "variants": scores}
    head, identities = (printed(table, 80) for table in run_command._tables(given))
    assert "HOTA" not in head
    assert "full" in head
    assert all(column in identities for column in ("HOTA", "IDF1", "Switches", "Switch rate"))
    assert "full" not in identities
    assert next(line.split() for line in identities.splitlines() if line.startswith("track")) == [
        "track", "61.2", "73.8", "3", "0.46",
    ]  # fmt: skip
    assert len(run_command._tables({**given, "variants": {"full": scores["full"]}})) == 1


def test_a_study_has_identities_where_variants_have_them():
    row = {
        "case": "", "faults.clock_offset": 0.067, "seed": 0, "pcp": 97.5, "recall": 80.0, "precision": 90.0,
        "mpjpe_mm": 40.0, "match_f1": 95.0, "ghosts": 0.25,
    }  # fmt: skip
    nothing = dict.fromkeys(("hota", "idf1", "id_switches", "switches_per_minute"))
    tracked = {"hota": 60.0, "idf1": 70.0, "id_switches": 3.0, "switches_per_minute": 0.456}
    lines = [{**row, "variant": "full", **nothing}, {**row, "variant": "track", **tracked}]
    lines += [{**each, "seed": 1, "hota": each["hota"] and 70.0} for each in lines]
    info = {"name": "clocks", "factors": ["faults.clock_offset"], "one_at_a_time": False}
    head, identities = study_command._tables(SimpleNamespace(info=info, trials=pl.DataFrame(lines)))
    assert [row[:2] for row in head.rows] == [("0.067", "full"), ("0.067", "track")]
    ((offset, variant, hota, _, switches, rate),) = identities.rows
    assert (offset, variant, switches.split("\n")[0], rate.split("\n")[0]) == ("0.067", "track", "3", "0.46")
    assert hota.split("\n")[0] == "65.0"
    (only,) = study_command._tables(SimpleNamespace(info=info, trials=pl.DataFrame(lines[:1])))
    assert only.rows[0][1] == "full"


def test_a_study_with_a_factor_says_where_points_are_lost(tmp_path):
    """PCP is linear in the synthetic study, 5 points a camera: they are lost one camera below the best."""
    results = make_study(tmp_path, factors={"cameras.count": [2, 3, 5]}, cases=("crowd", "empty"))
    (table,) = study_command._tables(results)
    assert table.rows[0] == ["crowd", "cameras.count", "full", "85.4 at 5", "70.4 at 2", "below 4 (3 to 5)"]
    assert [row[:3] for row in table.rows[1:3]] == [["", "", "fast"], ["empty", "cameras.count", "full"]]
    text = printed(table, 80)
    assert max(map(len, text.splitlines())) <= 80
    assert "continued" not in text


def test_a_factor_that_costs_little_is_said_to(tmp_path):
    results = make_study(tmp_path, factors={"people.count": [1, 2]}, slope=-1.0)
    (table,) = study_command._tables(results)
    assert table.rows[0] == ["people.count", "full", "59.4 at 1", "58.4 at 2", "not from 1 to 2"]
