"""Table and curves of the running time, read back from the text and the picture."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks.method.__main__ import main as bench
from benchmarks.method.curve import SWEEPS, Point, Sweep
from benchmarks.method.measure import Machine
from benchmarks.method.published import PAPER, SIZES, Comparison, others_at
from benchmarks.method.reid import Crops
from benchmarks.simulator.plot import curves, main
from benchmarks.simulator.result import Result, read
from benchmarks.simulator.table import markdown

RESULTS = Path(__file__).parents[3] / "results" / "time"
XLINK = "{http://www.w3.org/1999/xlink}"
PRESETS, COSTS = ("full", "fast"), ("total", "affinity", "matching", "reconstruction")
SCALE = {"full": 0.01, "fast": 0.001}
SHARE = {"total": 1.1, "affinity": 0.2, "matching": 0.5, "reconstruction": 0.3}


def point(views, people):
    """Times that grow with views ** 1.5 and people ** 2."""
    size = views**1.5 * people**2
    ms = {preset: {cost: SCALE[preset] * SHARE[cost] * size for cost in COSTS} for preset in PRESETS}
    return Point(views, people, views * people, ms)


def exponents(power):
    """Exponents that differ from those of the points, so that tests detect their source."""
    return {preset: {cost: power + SHARE[cost] + SCALE[preset] for cost in COSTS} for preset in PRESETS}


def made():
    sweeps = [
        Sweep(grows, [point(*size) for size in SWEEPS[grows]], exponents(power))
        for grows, power in (("views", 1.5), ("people", 2.0))
    ]
    return Result(
        command="python -m benchmarks.method --only published reid curve --json bench.json",
        machine=Machine("An Imagined Processor", 3),
        versions={"python": "3.11.7", "numpy": "2.4.6"},
        seconds=47.3,
        quick=False,
        published=[Comparison(point(*size), others_at(size), PAPER.get(size)) for size in SIZES],
        reid=[Crops(*size, crops=size[0] * size[1], frame=0.9 * size[0] * size[1], crop=0.9) for size in SIZES],
        curve=sweeps,
    )


def drawn(picture, line):
    """Positions of the marks of a line, (n, 2), in coordinates of the plot."""
    (group,) = picture.findall(f".//*[@id='{line}']")
    marks = [each for each in group.iter() if each.tag.endswith("}use")]
    assert all(mark.get(f"{XLINK}href") for mark in marks)
    return np.array([[float(mark.get("x")), float(mark.get("y"))] for mark in marks])


def check_curves(svg, result):
    """Check that in every plot one pair of logarithmic axes maps all figures to their marks."""
    picture = ElementTree.fromstring(svg)
    for grows in ("views", "people"):
        sweep = next(sweep for sweep in result.curve if sweep.grows == grows)
        assert len(sweep.points) > 1
        for preset in PRESETS:
            marks, figures = [], []
            for cost in COSTS:
                seen = drawn(picture, f"{grows}-{preset}-{cost}")
                assert len(seen) == len(sweep.points)
                marks.extend(seen)
                figures += [(getattr(each, grows), each.ms[preset][cost]) for each in sweep.points]
            (paper,) = [each for each in result.published if each.paper]
            for name, stages in (("paper", 3), ("paper-without", 2)):
                marks.extend(drawn(picture, f"{grows}-{preset}-{name}"))
                total = sum(list(paper.paper.values())[-stages:])  # affinity, which has the network, is the first
                figures.append((getattr(paper.ours, grows), total))
            released = drawn(picture, f"{grows}-{preset}-released")
            times = {
                (getattr(each.ours, grows), each.others["released, matching + 3DPS"])
                for each in result.published
                if (each.ours.views == 5 if grows == "people" else each.ours.people != 10 or each.ours.views != 5)
            }
            assert len(released) == len(times) > 0
            marks.extend(released[np.argsort(released[:, 0])])
            figures += sorted(times)
            marks, figures = np.array(marks), np.log10(np.array(figures))
            for axis, sign in ((0, 1), (1, -1)):  # y points down
                slope, offset = np.polyfit(figures[:, axis], marks[:, axis], 1)
                assert slope * sign > 10  # points a decade
                np.testing.assert_allclose(marks[:, axis], offset + slope * figures[:, axis], atol=0.01)


def tables(text):
    """Return the tables of a text in order, each as rows of cells."""
    found, last = [], None
    for line in text.splitlines():
        if not line.startswith("|"):
            last = None
        elif last is None:
            last = [[cell.strip() for cell in line.strip("|").split("|")]]
            found.append(last)
        elif not line.startswith("|:--"):
            last.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def numbers(text):
    """Return the figures of all rows, without heads and first columns."""
    return [re.findall(r"\d+\.?\d*", " ".join(row[1:])) for table in tables(text) for row in table[1:]]


def number(cell):
    return float(cell.split()[0].rstrip(","))


@pytest.mark.slow
def test_curves_are_at_the_figures():
    check_curves(curves(made()), made())


def test_the_table_by_stage_is_of_the_paper_s_size_and_adds_up():
    stages, *_ = tables(markdown(made()))
    assert stages[0] == ["ms per frame, medians", "`fast`", "`full`", "paper"]
    network, affinity, matching, reconstruction, without, whole = stages[1:]
    size = 5**1.5 * 4**2
    for row, cost in ((affinity, "affinity"), (matching, "matching"), (reconstruction, "reconstruction")):
        ours = [number(row[1]), number(row[2])]
        assert ours == pytest.approx([SHARE[cost] * size * SCALE[name] for name in ("fast", "full")], rel=5e-3)
    assert [number(row[3]) for row in (affinity, matching, reconstruction)] == [25, 20, 60]
    assert "GPU" in affinity[3]
    assert "20 crops" in network[0]
    assert number(network[1]) == number(network[2]) == pytest.approx(18)
    for column in (1, 2):
        assert number(whole[column]) == pytest.approx(number(without[column]) + 18, rel=5e-3)
    assert (number(without[3]), number(whole[3])) == (80, 105)


def test_the_table_of_sizes_compares_equal_work():
    _, whole, alone, *_ = tables(markdown(made()))
    assert [row[0] for row in whole[1:]] == [row[0] for row in alone[1:]] == [f"{v} × {p}" for v, p in SIZES]
    for (views, people), row, matching in zip(SIZES, whole[1:], alone[1:], strict=True):
        size = views**1.5 * people**2
        assert number(row[1]) == views * people
        fast, full, same, released = map(number, row[2:6])
        assert [fast, full, same] == pytest.approx([0.0011 * size, 0.011 * size, 0.008 * size], rel=5e-3)
        assert number(row[6]) == pytest.approx(released / (0.008 * size), abs=0.51)
        assert [number(cell) for cell in matching[1:3]] == pytest.approx([0.0005 * size, 0.005 * size], rel=5e-3)
    # Facts: the released code and EasyMocap at 5 x 4.
    assert number(whole[2][5]) == 28
    assert [number(cell) for cell in alone[2][3:]] == [4.6, 526, 3.5]


def test_growth_is_listed_by_point_with_its_exponent():
    *_, views, people = tables(markdown(made()))
    for table, power, sizes in ((views, 1.5, SWEEPS["views"]), (people, 2.0, SWEEPS["people"])):
        heads = [head.replace("`", "").split() for head in table[0][1:]]
        assert table[-1] == ["exponent", *(f"{exponents(power)[preset][cost]:.2f}" for preset, cost in heads)]
        assert len({(preset, cost) for preset, cost in heads}) == 8
        assert [row[0] for row in table[1:-1]] == [f"{v} × {p}" for v, p in sizes]
        column = table[0].index("`full` matching")
        times = [number(row[column]) for row in table[1:-1]]
        assert times == pytest.approx([0.005 * v**1.5 * p**2 for v, p in sizes], rel=5e-3)


def test_the_text_has_machine_command_and_duration():
    text = markdown(made())
    for part in ("An Imagined Processor, 3 cores", "numpy 2.4.6", f"    {made().command}\n", "47 s"):
        assert part in text
    assert "do not quote" not in text
    assert "do not quote" in markdown(replace(made(), quick=True))


def test_without_the_network_the_other_rows_remain():
    stages, *_ = tables(markdown(replace(made(), reid=[])))
    assert stages[1][1:3] == ["not measured"] * 2
    assert len(stages) == 6  # no sum with it


@pytest.mark.slow
def test_a_quick_run_has_all_sections_that_are_plotted(tmp_path, capsys):
    file, folder = tmp_path / "bench.json", tmp_path / "time"
    assert bench(["--quick", "--only", "published", "reid", "curve", "--json", str(file)]) == 0
    assert main([str(file), str(folder)]) == 0
    result = read(file)
    assert result.quick
    assert result.reid
    assert (folder / "table.md").read_text(encoding="utf-8") == markdown(result)
    check_curves((folder / "curves.svg").read_text(encoding="utf-8"), result)


def broken(change):
    result = asdict(made())
    change(result)
    return json.dumps(result)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "Invalid JSON"),
        ("[]", "be an object"),
        (broken(lambda result: result.pop("reid")), "reid"),
        (broken(lambda result: result.update(published=[])), "paper"),
        (broken(lambda result: result["curve"].pop(0)), "views"),
        (broken(lambda result: result["curve"][0]["points"][0].update(people=7)), "only views"),
        (broken(lambda result: result["curve"][1]["exponents"]["fast"].pop("total")), "people, fast: total"),
        (
            broken(lambda result: result["curve"][1]["points"][2]["ms"]["full"].update(matching=0.0)),
            "full at 5 × 4: matching",
        ),
        (
            broken(lambda result: result["published"][1]["ours"]["ms"]["fast"].update(total="soon")),
            "ours.ms.fast.total",
        ),
        (broken(lambda result: result["published"][1]["paper"].pop("matching")), "paper at 5 × 4: matching"),
        (broken(lambda result: result["published"][0]["others"].clear()), "others at 3 × 3"),
    ],
)
def test_an_invalid_result_gets_one_message(tmp_path, capsys, text, why):
    file = tmp_path / "bench.json"
    file.write_text(text)
    assert main([str(file), str(tmp_path / "time")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{file}: ")
    assert why in line
    assert "python -m benchmarks.method --only published reid curve --json bench.json" in line
    assert not (tmp_path / "time").exists()


def test_a_missing_file_is_named(tmp_path, capsys):
    assert main([str(tmp_path / "none.json"), str(tmp_path)]) == 2
    assert "none.json: No such file" in capsys.readouterr().err


def test_the_committed_figures_table_and_curves_agree():
    result = read(RESULTS / "bench.json")
    assert not result.quick
    committed, written = ((RESULTS / "table.md").read_text(encoding="utf-8"), markdown(result))
    # The committed text is of version 0.1, in the words of that version; the figures must agree.
    assert numbers(committed) == numbers(written)
    assert len(numbers(written)) > len(SIZES)
    check_curves((RESULTS / "curves.svg").read_text(encoding="utf-8"), result)
    assert tuple((each.ours.views, each.ours.people) for each in result.published) == SIZES
