"""Resolution of a scenario file: its base scenario, and the number of trials of its sweep, cases and seeds.

Settings are counted here and not made, so that a huge study costs neither time nor memory.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mvpose.files.message_text import all_in_one_line, shown
from simharness.scenario.checks import MOST_TRIALS, oversized
from simharness.scenario.document import Document, read_document
from simharness.scenario.layers import Origins, leaves, merge, nested, set_origin
from simharness.scenario.presets import KINDS, Presets, merge_with_presets
from simharness.scenario.sections.gate_section import GateSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sections.section import Section
from simharness.scenario.sweep import Sweep, SweepReader, Value
from simharness.scenario.toml_files import ScenarioError
from simharness.scenario.validation_messages import explain_all, origin_of


@dataclass(frozen=True)
class ScenarioCase:
    """Named change of the base; the base itself in a file without cases.

    Attributes:
        name: name of the case; "" where the file has no cases.
        data: keys of the scenario file with the changes.
        origins: origins of the keys.
        changes: keys that the case changes.
        scenario: resolved scenario.
        values: values of all swept keys, dotted, where they are not varied.
    """

    name: str
    data: dict[str, Any]
    origins: Origins
    changes: Mapping[str, Any]
    scenario: Scenario
    values: Mapping[str, Value]


@dataclass(frozen=True)
class ScenarioPlan:
    """Resolved scenario file: the base scenario, and what is varied.

    Attributes:
        document: keys of the file and its bases.
        base: the scenario without sweep and cases; its seed is the first one.
        seeds: seeds of every setting.
        sweep: factors and their values.
        cases: at least one case.
        gate: section [gate].
    """

    document: Document
    base: Scenario
    seeds: Sequence[int]
    sweep: Sweep
    cases: tuple[ScenarioCase, ...]
    gate: GateSection

    @property
    def settings(self) -> int:
        """Number of settings."""
        return sum(self.sweep.count(case.values) for case in self.cases)

    @property
    def trials(self) -> int:
        """Number of trials: settings times seeds."""
        return self.settings * len(self.seeds)

    @property
    def is_study(self) -> bool:
        """Whether there is more than the base at one seed."""
        return bool(self.sweep.axes or self.cases[0].name or len(self.seeds) > 1)


class Resolver:
    """Validation of settings; mistakes are collected in a list."""

    def __init__(self, document: Document, mistakes: list[str]) -> None:
        """Resolve settings of ``document``; append messages to ``mistakes``."""
        self._presets = Presets(document.folders)
        self._file = str(document.path)
        self._mistakes = mistakes
        self._sections: dict[Any, Section] = {}

    def scenario(self, data: dict[str, Any], origins: Origins) -> Scenario | None:
        """Return the scenario of some settings; None where they are not valid.

        Equal sections are shared as one object, because thousands of settings differ in a few sections.
        """
        try:
            data = self._presets.under(data, origins)
        except ScenarioError as error:
            self._mistakes.append(str(error))
            return None
        try:
            # Through JSON, where pydantic's strict mode accepts arrays as tuples: count = "4" and count = true are
            # refused, count = 4 and fov = 75 are accepted.
            scenario = Scenario.model_validate_json(json.dumps(data, default=str), strict=True)
        except ValidationError as error:
            self._mistakes += explain_all(error, origins, self._file)
            return None
        self._mistakes += [
            f"{origin_of(key.split('.'), origins, self._file)}: {message}" for key, message in oversized(scenario)
        ]
        sections = {key: section for key, section in scenario if isinstance(section, Section)}
        shared = {
            # Sections are shared only with equal sets of given keys: some checks depend on which keys were given.
            key: self._sections.setdefault((key, section, frozenset(section.model_fields_set)), section)
            for key, section in sections.items()
        }
        return scenario.model_copy(update=shared)

    def gate(self, data: Any, origins: Origins) -> GateSection:
        """Return the section [gate]."""
        try:
            return GateSection.model_validate_json(json.dumps(data, default=str), strict=True)
        except ValidationError as error:
            self._mistakes += explain_all(error, origins, self._file, section=("gate",))
            return GateSection()


def refuse(mistakes: Sequence[str]) -> None:
    """Raise a :class:`ScenarioError` with every distinct mistake, if there are any."""
    if mistakes:
        # All values of a range may be wrong in the same way: the message about the first is enough.
        messages = {re.split(", (?:e.g.|got) ", mistake)[0]: mistake for mistake in reversed(mistakes)}
        raise ScenarioError(all_in_one_line(list(reversed(messages.values()))))


def read_plan(
    path: Path | str,
    *,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    seeds: int | Sequence[int] | None = None,
    variants: Sequence[str] | None = None,
    folder: Path | None = None,
) -> ScenarioPlan:
    """Read and resolve a scenario file.

    Args:
        path: a TOML file, or the name of a shipped scenario.
        overrides: as in :func:`simharness.scenario.load.load`.
        seed: replaces the scenario's seed.
        seeds: replaces the study's seeds: their number, or a list of them.
        variants: replaces the variants.
        folder: folder to which files named in the scenario file are relative; by default that of the file.

    Raises:
        ScenarioError: as :func:`simharness.scenario.load.load`.
    """
    document = read_document(path, overrides=overrides, folder=folder)
    data, origins = dict(document.data), document.origins
    for key, value in (("seed", seed), ("seeds", seeds)):
        if value is not None:
            data[key] = list(value) if isinstance(value, Sequence) else value
            set_origin(origins, (key,), f"--{key}")
    if variants is not None:
        data = merge(data, {"method": {"variants": list(variants)}})
        set_origin(origins, ("method", "variants"), "--variants")

    mistakes: list[str] = []
    reader = SweepReader(origins, str(document.path), mistakes)
    resolver = Resolver(document, mistakes)
    sweep = reader.sweep(data.pop("sweep", {}))
    changes = reader.cases(data.pop("cases", {}), sweep) or {"": {}}
    gate = resolver.gate(data.pop("gate", {}), origins)
    all_seeds = _seeds(data, document, mistakes)
    _check_presets(data, sweep, reader, mistakes)
    base = resolver.scenario(data, origins)
    cases = [_case(name, changed, data, sweep, reader, resolver) for name, changed in changes.items()]
    if mistakes:  # report those of swept values as well: settings are not made after a mistake
        for axis in sweep.axes:
            for values in axis.values:
                resolver.scenario(*vary(data, origins, sweep, dict(zip(axis.keys, values, strict=True))))
    refuse(mistakes)
    assert base is not None
    return ScenarioPlan(document, base, all_seeds, sweep, tuple(filter(None, cases)), gate)


def vary(
    data: dict[str, Any], origins: Origins, sweep: Sweep, values: Mapping[str, Value]
) -> tuple[dict[str, Any], Origins]:
    """Return the keys of a scenario file with swept keys at some values, and the origins of all keys.

    Args:
        data: keys of a scenario file.
        origins: origins of the keys.
        sweep: the sweep of the values.
        values: values by dotted key.
    """
    changes: dict[str, Any] = {}
    origins = dict(origins)
    for dotted, value in values.items():
        key = tuple(dotted.split("."))
        changes = merge(changes, nested(key, value))
        set_origin(origins, key, sweep.origins[dotted])
    return merge_with_presets(data, changes), origins


def value_at(scenario: Scenario, data: Mapping[str, Any], key: str) -> Value:
    """Return the value of a dotted key in a setting; None where it has none, or different numbers for the joints.

    Args:
        scenario: the resolved setting.
        data: keys of its scenario file, which name its presets.
        key: dotted key of a scenario file.
    """
    for kind in KINDS:
        if key == f"{kind.section}.{kind.key}":
            return kind.name_in(data)
    value: Any = reduce(getattr, key.split("."), scenario)
    if not isinstance(value, Section):
        return value
    numbers = {each for _, each in value}
    return numbers.pop() if len(numbers) == 1 else None


def _case(
    name: str, changes: dict[str, Any], data: dict[str, Any], sweep: Sweep, reader: SweepReader, resolver: Resolver
) -> ScenarioCase | None:
    origins = dict(reader.origins)
    for key in leaves(changes):
        set_origin(origins, key, reader.origin(("cases", name, *key)))
    data = merge_with_presets(data, changes)
    scenario = resolver.scenario(data, origins)
    if scenario is None:
        return None
    values = {key: value_at(scenario, data, key) for key in sweep.keys}
    return ScenarioCase(name, data, origins, changes, scenario, values)


def _seeds(data: dict[str, Any], document: Document, mistakes: list[str]) -> Sequence[int]:
    """Remove the seeds from the data, and set the scenario's seed to the first of them."""
    origins, file = document.origins, str(document.path)
    seeds = data.pop("seeds", 1)
    origin = origin_of(("seeds",), origins, file)
    if isinstance(seeds, list) and seeds and all(isinstance(seed, int) and 0 <= seed < 2**53 for seed in seeds):
        if len(set(seeds)) < len(seeds):
            mistakes.append(f"{origin}: seeds: a seed is in the list twice; remove one of them")
        single = origin_of(("seed",), origins, file)
        if single.startswith("--"):
            mistakes.append(
                f"{single}: the study has a list of seeds, seeds = {shown(seeds)}, which replaces seed; set seeds "
                "instead, seeds = 1 for a single one"
            )
        data["seed"] = seeds[0]
        return tuple(seeds)
    if isinstance(seeds, bool) or not isinstance(seeds, int) or not 1 <= seeds <= MOST_TRIALS:
        mistakes.append(
            f"{origin}: seeds: expected a number of seeds, 1 to {MOST_TRIALS:,}, or a list of seeds, e.g. [0, 1, 2], "
            f"got {shown(seeds)}"
        )
        seeds = 1
    first = data.get("seed", 0)
    # A seed that is not a valid number is reported with the scenario.
    return range(first, first + seeds) if isinstance(first, int) and first < 2**53 else range(seeds)


def _check_presets(data: dict[str, Any], sweep: Sweep, reader: SweepReader, mistakes: list[str]) -> None:
    """Refuse to sweep over presets beside a section that is written out and would change each of them."""
    for kind in KINDS:
        key = f"{kind.section}.{kind.key}"
        written = data.get(kind.section)
        if key in sweep.keys and isinstance(written, Mapping) and written and not kind.name_in(data):
            where = reader.origin(("sweep", kind.section, kind.key))
            mistakes.append(
                f"{where}: [{kind.section}] has the keys {', '.join(written)}, "
                f"which would change every {kind.title} of the sweep; name the {kind.title} to which they belong, "
                f'[{kind.section}] {kind.key} = "NAME"'
            )
