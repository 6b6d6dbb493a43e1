"""Tables and command line of the rendering benchmark; the figures depend on the machine and are not tested."""

from __future__ import annotations

import json

import pytest

from benchmarks.simulator import rendering
from benchmarks.simulator.__main__ import main
from benchmarks.simulator.rendering import Measurement, table_of
from benchmarks.simulator.scenes import scenario


def test_targets_are_compared_with_the_median():
    lines = table_of(
        [
            Measurement("quick enough", 8.0, 7.0, 9.0),
            Measurement("too slow", 12.0, 8.0, 9.0),
            Measurement("many enough", 200.0, 210.0, 180.0, more=True),
            Measurement("too few", 150.0, 190.0, 180.0, more=True),
            Measurement("no target", 3.0, 2.0),
        ]
    ).splitlines()
    marks = {line.split("  ")[0]: ("✓" in line, "✗" in line) for line in lines[2:7]}
    assert marks == {
        "quick enough": (True, False),
        "too slow": (False, True),
        "many enough": (True, False),
        "too few": (False, True),
        "no target": (False, False),
    }


def test_sizes_and_targets_are_those_of_the_task():
    assert rendering.SIZES == {(640, 480): 5.0, (1032, 776): 12.0, (1920, 1080): 30.0}
    assert rendering.PARALLEL_RATE == 350.0
    staged = scenario()
    assert (staged.people.count, staged.cameras.count, staged.cameras.size) == (4, 5, (640, 480))
    assert staged.clutter.boxes + staged.clutter.shelves > 0


def test_an_unknown_section_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["--only", "rendring"])
    assert "rendering, simulation" in capsys.readouterr().err.replace("'", "")


@pytest.mark.slow
def test_the_command_prints_and_writes_its_figures(tmp_path, capsys):
    assert main(["--only", "rendering", "--quick", "--json", str(tmp_path / "figures.json")]) == 0
    written = json.loads((tmp_path / "figures.json").read_text())
    figures = {row["name"]: row for row in written["rendering"]}
    assert written["quick"]
    assert figures["triangles"]["value"] > 50_000
    assert all(row["value"] > 0 for row in figures.values())
    text = capsys.readouterr().out
    assert all(name in text for name in figures)
