"""Search files: values of keys as in [sweep], scenarios at some of them, and messages about mistakes."""

from pathlib import Path

import pytest

import benchmarks.hunt
from benchmarks.hunt.search_file import read_search
from simharness.scenario.toml_files import ScenarioError

HEAD = 'scenario = "quickstart"\noverrides = ["name=searched"]\n'
SEARCH = """[search]
people.count = { from = 2, to = 5, steps = 4 }
detector.profile = ["typical", "poor"]
detector.phantoms.rate = [0.0, 1e-5]
people.activities = [["walk"], ["walk", "stand"]]
"""


def read(tmp_path, text):
    (tmp_path / "searched.toml").write_text(text)
    return read_search(tmp_path / "searched.toml")


def test_axes_and_scenarios_at_their_values(tmp_path):
    search = read(tmp_path, HEAD + SEARCH)
    axes = {axis.keys: axis.values for axis in search.axes}
    assert axes[("people.count",)] == ((2,), (3,), (4,), (5,))
    assert len(axes) == 4
    shares = (0.0, 0.24, 0.26, 0.9, 1.0)
    assert [search.chosen([share, 0, 0, 0])["people.count"] for share in shares] == [2, 2, 3, 5, 5]
    assert (search.base.people.count, search.base.name) == (4, "searched")
    scenario = search.at(search.chosen([1.0, 1.0, 1.0, 1.0]), 11)
    assert (scenario.people.count, scenario.detector.name, scenario.seed) == (5, "poor, changed", 11)
    assert scenario.detector.phantoms.rate == 1e-5
    assert scenario.people.activities == ("walk", "stand")
    assert scenario.name == "searched"
    with pytest.raises(ScenarioError, match=r"\[search\]: .*people.count"):
        search.at({"people.count": -1}, 0)


def test_the_shipped_search_is_read():
    assert len(read_search(Path(benchmarks.hunt.__file__).with_name("room.toml")).axes) == 5


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("", "nothing to search"),
        ("people.count = { from = 2, to = 5 }", "steps"),
        ("people.count = 3", "expected values"),
        ("people.number = [1, 2]", r"\[search\]: people.number is not a key"),
        ("seed = [1, 2]", "seed cannot be swept"),
        ("people.count = [2, 1000]", r"\[search\]: .*people.count"),
        ('detector.profile = ["typical", "none such"]', "none such"),
        ("one_at_a_time = true", "only a sweep has this"),
        ("sweep.people.count = [1, 2]", "sweep"),
    ],
)
def test_mistakes_of_the_search(tmp_path, line, message):
    with pytest.raises(ScenarioError, match=message):
        read(tmp_path, f"{HEAD}[search]\n{line}\n")


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("", "scenario: expected"),
        ('scenario = "no such"', "no such"),
        ('scenario = "quickstart"\noverrides = "people.count=6"', "overrides: expected"),
        ('scenario = "quickstart"\noverrides = ["people.count=-1"]', "people.count"),
        ('scenario = "quickstart"\nseed = 3', "seed: not a key"),
    ],
)
def test_mistakes_of_the_scenario(tmp_path, head, message):
    with pytest.raises(ScenarioError, match=message):
        read(tmp_path, f"{head}\n[search]\npeople.count = [2, 3]\n")
