"""Section [search]: values of keys as in [sweep], scenarios at some of them, and messages about mistakes."""

import pytest

from simharness.scenario.load import load, read_plan
from simharness.scenario.toml_files import ScenarioError

SEARCH = """
extends = "quickstart"
name = "searched"
[search]
people.count = { from = 2, to = 5, steps = 4 }
detector.profile = ["typical", "poor"]
[[search.paired]]
cameras.count = [3, 5]
cameras.radius = [3.0, 3.5]
"""


def plan_of(tmp_path, text):
    (tmp_path / "searched.toml").write_text(text)
    return read_plan(tmp_path / "searched.toml")


def test_axes_and_scenarios_at_their_values(tmp_path):
    plan = plan_of(tmp_path, SEARCH)
    axes = {axis.keys: axis.values for axis in plan.search.axes}
    assert axes[("people.count",)] == ((2,), (3,), (4,), (5,))
    assert axes[("cameras.count", "cameras.radius")] == ((3, 3.0), (5, 3.5))
    count = plan.search.axes[0]
    assert [dict(count.at(share))["people.count"] for share in (0.0, 0.24, 0.26, 0.9, 1.0)] == [2, 2, 3, 5, 5]
    assert not plan.is_study
    assert load(tmp_path / "searched.toml").people.count == 4  # of the base
    scenario = plan.at({"people.count": 5, "detector.profile": "poor"}, 11)
    assert (scenario.people.count, scenario.detector.name, scenario.seed) == (5, "poor", 11)
    with pytest.raises(ScenarioError, match=r"\[search\]: .*people.count"):
        plan.at({"people.count": -1}, 0)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("people.count = { from = 2, to = 5 }", "steps"),
        ("people.count = 3", "expected values"),
        ("people.number = [1, 2]", r"\[search\]: people.number is not a key"),
        ("seed = [1, 2]", "seed cannot be swept"),
        ("people.count = [2, 1000]", r"\[search\]: people.count"),
        ('detector.profile = ["typical", "none such"]', "none such"),
        ("one_at_a_time = true", "only a sweep has this"),
        ("pairwise = true", "only a sweep has this"),
        ("sweep.people.count = [1, 2]", "sweep"),
    ],
)
def test_mistakes(tmp_path, line, message):
    with pytest.raises(ScenarioError, match=message):
        plan_of(tmp_path, f'extends = "quickstart"\nname = "searched"\n[search]\n{line}\n')
