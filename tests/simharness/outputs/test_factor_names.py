"""Names and units of swept keys: every key that a study of this project sweeps has a name; units are the scenario's."""

import tomllib
from pathlib import Path

import pytest

from simharness.outputs import texts_of
from simharness.outputs.study.curves import axis_label, unit_of

SCENARIOS = Path(__file__).parents[3] / "scenarios"


def swept():
    """Return all keys that scenario files sweep."""

    def walk(table, above=()):
        for key, value in table.items():
            if isinstance(value, dict) and "from" not in value:
                yield from walk(value, (*above, key))
            elif key == "paired":
                yield from (dotted for each in value for dotted in list(walk(each))[:1])  # the others go with the first
            elif key != "one_at_a_time":
                yield ".".join((*above, key))

    files = [tomllib.loads(file.read_text(encoding="utf-8")) for file in sorted(SCENARIOS.glob("*.toml"))]
    return {key for file in files for key in walk(file.get("sweep", {}))}


@pytest.mark.parametrize("key", sorted(swept()))
def test_what_a_study_sweeps_has_a_name(key):
    assert key in texts_of("axis_names")


@pytest.mark.parametrize(
    ("key", "unit"),
    [
        ("faults.translation", "m"),
        ("faults.translation_drift", "m per minute"),
        ("faults.rotation", "degrees"),
        ("faults.rotation_drift", "degrees per minute"),
        ("faults.clock_offset", "s"),
        ("faults.center", "px"),
        ("faults.focal", "relative"),
        ("detector.phantoms.life", "s"),
        ("rate", "Hz"),
        ("people.assist", "N"),
        ("cameras.count", ""),
        ("people.count", ""),
        ("detector.profile", ""),  # not a key of a scenario: one name for many parameters
        ("cameras.count.more", ""),
        ("people.children", ""),  # its description has years, but as an age and not as the unit
    ],
)
def test_the_unit_is_the_one_of_the_description(key, unit):
    assert unit_of(key) == unit
    assert axis_label(key) == texts_of("axis_names").get(key, key) + (f", {unit}" if unit else "")
