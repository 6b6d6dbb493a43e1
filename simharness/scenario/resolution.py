"""What a scenario file amounts to: its base, and how many trials its sweep, cases and seeds make.

Settings are counted here, not made: however many they are, it takes neither long nor much memory.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from simharness.scenario.extends import Document, read_document
from simharness.scenario.layers import Places, leaves, nested, over, set_place
from simharness.scenario.presets import KINDS, Presets, layered
from simharness.scenario.sections.gate import Gate
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sections.section import Section
from simharness.scenario.sweep import Sweep, SweepReader, Value
from simharness.scenario.toml_reader import ScenarioError
from simharness.scenario.validation_messages import explain, place_of


@dataclass(frozen=True)
class Case:
    """A named change of the base; the base itself in a file without cases.

    Attributes:
        name: "" where the file has none.
        data: the keys of its scenario file.
        places: who set a key.
        changes: the keys that it changes.
        scenario: what they make.
        values: of all swept keys, dotted, where they are not varied.
    """

    name: str
    data: dict[str, Any]
    places: Places
    changes: Mapping[str, Any]
    scenario: Scenario
    values: Mapping[str, Value]


@dataclass(frozen=True)
class Plan:
    """What a scenario file amounts to.

    Attributes:
        document: what the file and its bases say.
        base: the scenario without sweep and cases; its seed is the first.
        seeds: of every setting.
        sweep: what is varied.
        cases: at least one.
        gate: section [gate].
    """

    document: Document
    base: Scenario
    seeds: Sequence[int]
    sweep: Sweep
    cases: tuple[Case, ...]
    gate: Gate

    @property
    def settings(self) -> int:
        """How many settings there are."""
        return sum(self.sweep.count(case.values) for case in self.cases)

    @property
    def trials(self) -> int:
        """How many trials: settings times seeds."""
        return self.settings * len(self.seeds)

    @property
    def is_study(self) -> bool:
        """Whether it is more than the base at its seed."""
        return bool(self.sweep.axes or self.cases[0].name or len(self.seeds) > 1)


class Resolver:
    """Makes scenarios of settings; what is wrong with them goes to a list."""

    def __init__(self, document: Document, mistakes: list[str]) -> None:
        """Resolve settings of ``document``, and append to ``mistakes``."""
        self._presets = Presets(document.folders)
        self._file = str(document.path)
        self._mistakes = mistakes
        self._sections: dict[Any, Section] = {}

    def scenario(self, data: dict[str, Any], places: Places) -> Scenario | None:
        """The scenario that settings make; None where they make none.

        Sections that are equal are one object: thousands of settings differ in a few.
        """
        try:
            data = self._presets.under(data, places)
        except ScenarioError as error:
            self._mistakes.append(str(error))
            return None
        try:
            # Through JSON, for that is where pydantic's strict mode still takes arrays for tuples: count = "4"
            # and count = true are refused, count = 4 and fov = 75 are fine.
            scenario = Scenario.model_validate_json(json.dumps(data, default=str), strict=True)
        except ValidationError as error:
            self._explain(error, places)
            return None
        sections = {key: section for key, section in scenario if isinstance(section, Section)}
        shared = {
            # Which keys a section was given is part of what it says: a layout that was not may be missed.
            key: self._sections.setdefault((key, section, frozenset(section.model_fields_set)), section)
            for key, section in sections.items()
        }
        return scenario.model_copy(update=shared)

    def gate(self, said: Any, places: Places) -> Gate:
        """The section [gate]."""
        try:
            return Gate.model_validate_json(json.dumps(said, default=str), strict=True)
        except ValidationError as error:
            self._explain(error, places, "gate")
            return Gate()

    def _explain(self, error: ValidationError, places: Places, *above: str) -> None:
        for mistake in error.errors():
            located: Any = {**mistake, "loc": (*above, *mistake["loc"])}
            self._mistakes.append(explain(located, places, self._file))


def refuse(mistakes: Sequence[str]) -> None:
    """Raise a :class:`ScenarioError` that says every mistake once, where there are any."""
    if mistakes:
        # All values of a range may be wrong in the same way: the first that was got will do.
        said = {mistake.rpartition(", got ")[0] or mistake: mistake for mistake in reversed(mistakes)}
        raise ScenarioError("\n".join(reversed(said.values())))


def read_plan(
    path: Path | str,
    *,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    seeds: int | Sequence[int] | None = None,
    variants: Sequence[str] | None = None,
    folder: Path | None = None,
) -> Plan:
    """Read what a scenario file amounts to.

    Args:
        path: a TOML file.
        overrides: as of :func:`simharness.scenario.load.load`.
        seed: replaces the scenario's seed.
        seeds: replaces the study's seeds: how many, or which.
        variants: replaces the variants.
        folder: what files that the scenario file names are relative to; by default its own.

    Raises:
        ScenarioError: as :func:`simharness.scenario.load.load`.
    """
    document = read_document(path, overrides=overrides, folder=folder)
    data, places = dict(document.data), document.places
    for key, value in (("seed", seed), ("seeds", seeds)):
        if value is not None:
            data[key] = list(value) if isinstance(value, Sequence) else value
            set_place(places, (key,), f"--{key}")
    if variants is not None:
        data = over(data, {"method": {"variants": list(variants)}})
        set_place(places, ("method", "variants"), "--variants")

    mistakes: list[str] = []
    reader = SweepReader(places, str(document.path), mistakes)
    resolver = Resolver(document, mistakes)
    sweep = reader.sweep(data.pop("sweep", {}))
    changes = reader.cases(data.pop("cases", {}), sweep) or {"": {}}
    gate = resolver.gate(data.pop("gate", {}), places)
    all_seeds = _seeds(data, document, mistakes)
    _check_presets(data, sweep, reader, mistakes)
    base = resolver.scenario(data, places)
    cases = [_case(name, changed, data, sweep, reader, resolver) for name, changed in changes.items()]
    if mistakes:  # then say those of swept values, too, which nobody gets to
        for axis in sweep.axes:
            for values in axis.values:
                resolver.scenario(*vary(data, places, sweep, dict(zip(axis.keys, values, strict=True))))
    refuse(mistakes)
    assert base is not None
    return Plan(document, base, all_seeds, sweep, tuple(filter(None, cases)), gate)


def vary(
    data: dict[str, Any], places: Places, sweep: Sweep, values: Mapping[str, Value]
) -> tuple[dict[str, Any], Places]:
    """The settings with swept keys at values, and who set them.

    Args:
        data: the keys of a scenario file.
        places: who set a key.
        sweep: that the values are from.
        values: of dotted keys.
    """
    changes: dict[str, Any] = {}
    places = dict(places)
    for dotted, value in values.items():
        key = tuple(dotted.split("."))
        changes = over(changes, nested(key, value))
        set_place(places, key, sweep.places[dotted])
    return layered(data, changes), places


def value_at(scenario: Scenario, data: Mapping[str, Any], key: str) -> Value:
    """What a setting has for a dotted key; None where there is nothing, or not one number for all joints.

    Args:
        scenario: the setting, resolved.
        data: the keys of its scenario file, which name its presets.
        key: of a scenario file.
    """
    for kind in KINDS:
        if key == f"{kind.section}.{kind.key}":
            return kind.named(data)
    value: Any = reduce(getattr, key.split("."), scenario)
    if not isinstance(value, Section):
        return value
    numbers = {each for _, each in value}
    return numbers.pop() if len(numbers) == 1 else None


def _case(
    name: str, changes: dict[str, Any], data: dict[str, Any], sweep: Sweep, reader: SweepReader, resolver: Resolver
) -> Case | None:
    places = dict(reader.places)
    for key in leaves(changes):
        set_place(places, key, reader.place(("cases", name, *key)))
    data = layered(data, changes)
    scenario = resolver.scenario(data, places)
    if scenario is None:
        return None
    values = {key: value_at(scenario, data, key) for key in sweep.keys}
    return Case(name, data, places, changes, scenario, values)


def _seeds(data: dict[str, Any], document: Document, mistakes: list[str]) -> Sequence[int]:
    """Take the seeds out of the data, and put the first where the scenario's is."""
    places, file = document.places, str(document.path)
    said = data.pop("seeds", 1)
    place = place_of(("seeds",), places, file)
    if isinstance(said, list) and said and all(isinstance(seed, int) and seed >= 0 for seed in said):
        if len(set(said)) < len(said):
            mistakes.append(f"{place}: seeds: a seed is in the list twice; take one out")
        chosen = place_of(("seed",), places, file)
        if chosen.startswith("--"):
            mistakes.append(f"{chosen}: the study lists its seeds, seeds = {said}; replace those, seeds = 1 for one")
        data["seed"] = said[0]
        return tuple(said)
    if isinstance(said, bool) or not isinstance(said, int) or said < 1:
        shown = json.dumps(said, default=str)
        mistakes.append(
            f"{place}: seeds: expected how many, 1 or more, or a list of them such as [0, 1, 2], got {shown}"
        )
        said = 1
    first = data.get("seed", 0)
    return range(first, first + said) if isinstance(first, int) else range(said)  # the scenario says what is wrong


def _check_presets(data: dict[str, Any], sweep: Sweep, reader: SweepReader, mistakes: list[str]) -> None:
    """Refuse to sweep over presets that all would be changed by a section that was written out."""
    for kind in KINDS:
        key = f"{kind.section}.{kind.key}"
        written = data.get(kind.section)
        if key in sweep.keys and isinstance(written, Mapping) and written and not kind.named(data):
            mistakes.append(
                f"{reader.place(('sweep', kind.section, kind.key))}: [{kind.section}] says {', '.join(written)}, which "
                f"would change every {kind.title} of the sweep; name the {kind.title} that they belong to, "
                f'[{kind.section}] {kind.key} = "NAME"'
            )
