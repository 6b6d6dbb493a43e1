"""Search file: a scenario, and the values of its keys that a hunt may choose.

``scenario`` names a shipped scenario or a file, relative to the search file; ``overrides`` is a list of changes of it,
``"people.count=6"``; the table ``[search]`` has keys of a scenario, each with a list or a range of values, as the
section [sweep] of a scenario file.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mvpose.files.message_text import shown
from simharness.scenario.checks import refuse
from simharness.scenario.document import find_scenario
from simharness.scenario.layers import Key
from simharness.scenario.load import load
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sweep import Axis, SweepReader, Value
from simharness.scenario.toml_files import ScenarioError, read_toml

_OF_SWEEPS = {"one_at_a_time", "refine", "paired"}


class _SearchReader(SweepReader):
    """Reader of [search], whose keys are written as those of a sweep."""

    def origin(self, key: Key) -> str:
        """Return the file and section, with which messages begin."""
        return f"{self._file}, [search]"


@dataclass(frozen=True)
class SearchFile:
    """Scenario and the values that may change in it."""

    path: Path
    """The file."""
    scenario: Path
    """File of the scenario."""
    overrides: tuple[str, ...]
    """Changes of the scenario in all trials."""
    base: Scenario
    """The scenario with these changes."""
    axes: tuple[Axis, ...]
    """Keys with their values; a single key each."""

    def chosen(self, shares: list[float]) -> dict[str, Value]:
        """Return the values of all keys at shares of the way through them, 0 to 1 each."""
        values = {}
        for axis, share in zip(self.axes, shares, strict=True):
            which = min(int(share * len(axis.values)), len(axis.values) - 1)
            values[axis.keys[0]] = axis.values[which][0]
        return values

    def at(self, values: Mapping[str, Value], seed: int) -> Scenario:
        """Return the scenario at values of the keys and a seed.

        Raises:
            ScenarioError: the values are not valid together.
        """
        changes = (f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items())
        try:
            return load(self.scenario, overrides=[*self.overrides, *changes]).model_copy(update={"seed": seed})
        except ScenarioError as error:
            raise ScenarioError(f"{self.path}, [search]: {error}") from None


def read_search(path: Path) -> SearchFile:
    """Read a search file, and check each value of its keys alone.

    Raises:
        ScenarioError: the file does not exist or is not TOML, has other keys or nothing to search, or the scenario is
            not valid with a value of the search.
    """
    data = read_toml(path)
    if unknown := sorted(data.keys() - {"scenario", "overrides", "search"}):
        raise ScenarioError(f"{path}: {', '.join(unknown)}: not a key; expected scenario, overrides and [search]")
    name, overrides, search = data.get("scenario"), data.get("overrides", []), data.get("search", {})
    if not isinstance(name, str):
        got = "nothing" if name is None else shown(name)
        raise ScenarioError(f"{path}: scenario: expected a scenario file or the name of a shipped one, got {got}")
    if not isinstance(overrides, list) or not all(isinstance(each, str) for each in overrides):
        raise ScenarioError(f'{path}: overrides: expected a list such as ["people.count=6"], got {shown(overrides)}')
    axes = _axes(path, search)
    scenario = find_scenario(name, folder=path.parent)
    found = SearchFile(path, scenario, tuple(overrides), load(scenario, overrides=overrides), axes)
    for axis in axes:
        for (value,) in axis.values:
            found.at({axis.keys[0]: value}, 0)
    return found


def _axes(path: Path, search: Any) -> tuple[Axis, ...]:
    """Return the keys of [search] with their values.

    Raises:
        ScenarioError: a key or its values are not valid, or there are none.
    """
    if not isinstance(search, Mapping) or not search:
        raise ScenarioError(
            f"{path}: has nothing to search; add a table [search] with keys and their values: "
            "people.count = { from = 2, to = 8, steps = 7 }"
        )
    if other := sorted(_OF_SWEEPS & search.keys()):
        raise ScenarioError(f"{path}, [search]: {', '.join(other)}: only a sweep has this; remove it")
    mistakes: list[str] = []
    axes = _SearchReader({}, str(path), mistakes).sweep(search).axes
    refuse(mistakes)
    return axes
