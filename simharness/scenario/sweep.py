"""[sweep], [search], [cases] and seeds: values of keys of a scenario, their combinations, the keys of each setting."""

import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

from mvpose.files.message_text import shown
from simharness.scenario import layers
from simharness.scenario.file_model import MOST_TRIALS
from simharness.scenario.pairwise import pairwise
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sections.section import Section
from simharness.scenario.validation_messages import explain, is_key, origin_of, section_at

Value = str | int | float | bool | tuple[Any, ...] | None

MOST_ADDED = 20
"""Largest number of values by which each key of a sweep may be refined."""

_MOST_STEPS = 10_000
_MOST_PAIRS = 400  # settings of a pairwise sweep take seconds to find from there on
_HOW = 'write a list, [2, 3, 5], or a range, { from = 0.0, to = 2.0, steps = 5 }, geometric with scale = "log"'
_SEEDS = "write seeds = 20, or a list of seeds, at the top of the file"
_NAMES = "write [cases.NAME] with the keys that differ"
_VARIANTS = 'write variants = ["full", "fast"] at the top of the file: all variants get the same detections'
NOT_VARIED: dict[layers.Key, str] = {
    ("seed",): _SEEDS,
    ("seeds",): _SEEDS,
    ("name",): _NAMES,
    ("description",): _NAMES,
    ("variants",): _VARIANTS,
    ("method", "variants"): _VARIANTS,
    ("method", "estimators"): _VARIANTS,
    ("extends",): "a study has one base; write one study for each base",
    ("gate",): "a study has one gate",
    ("sweep",): "a study has one [sweep]",
    ("cases",): "a study has one table of [cases]",
    ("search",): "a scenario has one [search]",
}


@dataclass(frozen=True)
class Axis:
    """Keys that are varied together; most often a single key."""

    keys: tuple[str, ...]
    """Dotted keys, (k,)."""
    values: tuple[tuple[Value, ...], ...]
    """Values of the keys, (steps, k)."""

    @property
    def is_numeric(self) -> bool:
        """Whether it has numbers of a single key."""
        return all(len(each) == 1 and type(each[0]) in (int, float) for each in self.values)

    def at(self, share: float) -> list[tuple[str, Value]]:
        """Return the keys with their values at a share of the way through the values, 0 to 1."""
        which = min(int(share * len(self.values)), len(self.values) - 1)
        return list(zip(self.keys, self.values[which], strict=True))

    def others(self, base: Mapping[str, Value]) -> list[tuple[Value, ...]]:
        """Return the values that differ from those of the base."""
        base_values = tuple(base[key] for key in self.keys)
        return [values for values in self.values if values != base_values]


@dataclass(frozen=True)
class Sweep:
    """Axes of a study."""

    axes: tuple[Axis, ...] = ()
    """Axes in the order of the file."""
    one_at_a_time: bool = False
    """Whether the settings are the base and each axis alone; else all combinations."""
    origins: Mapping[str, str] = field(default_factory=dict)
    """Origin of the values of each dotted key, for messages."""
    refine: int = 0
    """Largest number of values that a run adds to each key where scores break."""
    pairwise: bool = False
    """Whether the settings are few combinations, with every pair of values of two axes, instead of all."""

    def with_values(self, added: Mapping[str, Sequence[Value]]) -> "Sweep":
        """Return the sweep with more values of keys that are varied alone, ascending."""
        return replace(
            self,
            axes=tuple(
                replace(axis, values=tuple(sorted((*axis.values, *((value,) for value in new)))))
                if (new := added.get(axis.keys[0], ()))
                else axis
                for axis in self.axes
            ),
        )

    @property
    def keys(self) -> tuple[str, ...]:
        """All dotted keys."""
        return tuple(key for axis in self.axes for key in axis.keys)

    def count(self, base: Mapping[str, Value], *, refined: bool = False) -> int:
        """Return the number of settings of :meth:`settings`, without making them.

        Args:
            base: values of all swept keys where they are not varied.
            refined: whether with as many more values as a run may add, to each axis with numbers of a single key.
        """
        added = [self.refine if refined and axis.is_numeric else 0 for axis in self.axes]
        if self.one_at_a_time:
            return 1 + sum(len(axis.others(base)) for axis in self.axes) + sum(added)
        if self.pairwise:
            return len(pairwise(self._sizes))
        return math.prod(len(axis.values) + more for axis, more in zip(self.axes, added, strict=True))

    @property
    def _sizes(self) -> tuple[int, ...]:
        """Numbers of values of the axes."""
        return tuple(len(axis.values) for axis in self.axes)

    def settings(self, base: Mapping[str, Value]) -> Iterator[tuple[str, dict[str, Value]]]:
        """Yield the varied key, "" for the base and for combinations, and the values of all keys that change.

        Args:
            base: values of all swept keys where they are not varied.
        """
        if self.one_at_a_time:
            yield "", {}
            for axis in self.axes:
                for values in axis.others(base):
                    yield axis.keys[0], dict(zip(axis.keys, values, strict=True))
        else:
            for places in pairwise(self._sizes) if self.pairwise else itertools.product(*map(range, self._sizes)):
                combination = [axis.values[place] for axis, place in zip(self.axes, places, strict=True)]
                yield "", dict(zip(self.keys, itertools.chain(*combination), strict=True))


class SweepReader:
    """Reader of [sweep], [cases] and seeds; mistakes are collected in a list."""

    def __init__(self, origins: layers.Origins, file: str, mistakes: list[str]) -> None:
        """Read sections of ``file``, whose keys have the origins ``origins``; append messages to ``mistakes``."""
        self.origins = origins
        self._file = file
        self._mistakes = mistakes
        self._swept: dict[str, str] = {}

    def sweep(self, section: Any, name: str = "sweep") -> Sweep:
        """Return the axes of [sweep], or those of [search], which have no settings of their own."""
        if not isinstance(section, Mapping):
            message = f"{name}: expected a section [{name}] with keys of a scenario, got {_shown(section)}"
            self._refuse((name,), message)
            return Sweep()
        if name == "search" and (other := {"one_at_a_time", "pairwise", "refine"} & section.keys()):
            self._refuse((name, *other), f"{', '.join(sorted(other))}: only a sweep has this; remove it")
        section = dict(section)
        flags = {key: section.pop(key, False) for key in ("one_at_a_time", "pairwise")}
        for flag, value in flags.items():
            if not isinstance(value, bool):
                self._refuse(("sweep", flag), f"{flag}: expected true, got {_shown(value)}")
        refine = section.pop("refine", 0)
        if isinstance(refine, bool) or not isinstance(refine, int) or not 0 <= refine <= MOST_ADDED:
            self._refuse(("sweep", "refine"), f"refine: expected 0 to {MOST_ADDED} values, got {_shown(refine)}")
            refine = 0
        paired = section.pop("paired", [])
        axes = [
            Axis((dotted,), tuple((value,) for value in values)) for dotted, values in self._varied(section, (name,))
        ]
        for axis in axes:
            self._refuse_repeated(axis, (name, *axis.keys[0].split(".")))
        if isinstance(paired, list) and all(isinstance(table, Mapping) for table in paired):
            axes += filter(None, map(self._pair, paired))
        else:
            self._refuse((name, "paired"), f"paired: expected tables [[{name}.paired]], got {_shown(paired)}")
        keys = [tuple(key.split(".")) for axis in axes for key in axis.keys]
        for index, key in enumerate(keys):
            if clash := next((other for other in keys[:index] if layers.overlap(key, other)), None):
                also = "" if clash == key else f", because {'.'.join(clash)} is swept"
                self._refuse((name, *key), f"{'.'.join(key)} is swept twice{also}; remove one of them")
        few = flags["pairwise"] is True
        if few and (flags["one_at_a_time"] or refine):
            wrong = "refine" if refine else "one_at_a_time"
            self._refuse(("sweep", "pairwise"), f"pairwise: does not go with {wrong}; remove one of them")
        sizes = sorted(len(axis.values) for axis in axes)[-2:]
        if few and math.prod(sizes) > _MOST_PAIRS:
            pairs = f"{sizes[0]:,} x {sizes[-1]:,}"
            self._refuse(
                ("sweep", "pairwise"),
                f"pairwise: two keys have {pairs} pairs of values, more than {_MOST_PAIRS:,}; sweep over fewer values",
            )
            few = False
        return Sweep(tuple(axes), flags["one_at_a_time"] is True, self._swept, refine, few)

    def cases(self, section: Any, sweep: Sweep) -> dict[str, dict[str, Any]]:
        """Return the changes of every case of [cases]."""
        if not isinstance(section, Mapping) or not all(isinstance(changes, Mapping) for changes in section.values()):
            expected = "expected a section [cases.NAME] for each case, with the keys that it changes"
            self._refuse(("cases",), f"cases: {expected}, got {_shown(section)}")
            return {}
        swept = [tuple(key.split(".")) for key in sweep.keys]
        for name, changes in section.items():
            if not name or not set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789_-"):
                expected = "expected a name of lowercase letters, digits, - and _"
                self._refuse(("cases", name), f"cases.{name}: {expected}")
            for key in _written(changes):
                dotted = ".".join(key)
                if key in NOT_VARIED or key[:1] in NOT_VARIED:
                    how = NOT_VARIED.get(key) or NOT_VARIED[key[:1]]
                    self._refuse(("cases", name, *key), f"a case cannot change {dotted}: {how}")
                elif any(layers.overlap(key, other) for other in swept):
                    self._refuse(
                        ("cases", name, *key), f"{dotted} is swept as well; remove it from the case or from the sweep"
                    )
        return {name: dict(changes) for name, changes in section.items()}

    def seeds(self, data: dict[str, Any]) -> Sequence[int]:
        """Remove the seeds from the keys of the file, set the scenario's seed to the first of them, and return them."""
        seeds = data.pop("seeds", 1)
        origin = origin_of(("seeds",), self.origins, self._file)
        if isinstance(seeds, list) and seeds and all(isinstance(seed, int) and 0 <= seed < 2**53 for seed in seeds):
            if len(set(seeds)) < len(seeds):
                self._mistakes.append(f"{origin}: seeds: a seed is in the list twice; remove one of them")
            single = origin_of(("seed",), self.origins, self._file)
            if single.startswith("--"):
                self._mistakes.append(
                    f"{single}: the study has a list of seeds, seeds = {shown(seeds)}, which replaces seed; set seeds "
                    "instead, seeds = 1 for a single one"
                )
            data["seed"] = seeds[0]
            return tuple(seeds)
        if isinstance(seeds, bool) or not isinstance(seeds, int) or not 1 <= seeds <= MOST_TRIALS:
            self._mistakes.append(
                f"{origin}: seeds: expected a number of seeds, 1 to {MOST_TRIALS:,}, or a list of seeds, e.g. "
                f"[0, 1, 2], got {shown(seeds)}"
            )
            seeds = 1
        first = data.get("seed", 0)
        # A seed that is not a valid number is reported with the scenario.
        return range(first, first + seeds) if isinstance(first, int) and first < 2**53 else range(seeds)

    def check_presets(self, data: Mapping[str, Any], sweep: Sweep) -> None:
        """Refuse to sweep over presets beside a section that is written out and would change each of them."""
        for kind in layers.PRESET_KINDS:
            key = f"{kind.section}.{kind.key}"
            written = data.get(kind.section)
            if key in sweep.keys and isinstance(written, Mapping) and written and not kind.name_in(data):
                self._refuse(
                    ("sweep", kind.section, kind.key),
                    f"[{kind.section}] has the keys {', '.join(written)}, "
                    f"which would change every {kind.title} of the sweep; name the {kind.title} to which they belong, "
                    f'[{kind.section}] {kind.key} = "NAME"',
                )

    def change(
        self, data: dict[str, Any], name: str, changes: Mapping[str, Any]
    ) -> tuple[dict[str, Any], layers.Origins]:
        """Return the keys of the file with the changes of a case, and the origins of all keys."""
        origins = dict(self.origins)
        for key, _ in layers.leaves(changes):
            layers.set_origin(origins, key, self.origin(("cases", name, *key)))
        return layers.merge_with_presets(data, changes), origins

    def origin(self, key: layers.Key) -> str:
        """Return the origin of a key of [sweep], [search] or [cases], with which its messages begin."""
        origin = origin_of(key, self.origins, self._file)
        section = ".".join(key[:2]) if key[0] == "cases" else key[0]
        return origin if origin.startswith("--") else f"{origin}, [{section}]"

    def _refuse(self, key: layers.Key, message: str) -> None:
        self._mistakes.append(f"{self.origin(key)}: {message}")

    def _pair(self, table: Mapping[str, Any]) -> Axis | None:
        varied = dict(self._varied(table, ("sweep", "paired")))
        lengths = {key: len(values) for key, values in varied.items()}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{length} of {key}" for key, length in lengths.items())
            self._refuse(("sweep", "paired"), f"lists of [[sweep.paired]] must have the same length, got {counts}")
            return None
        if not varied:
            return None
        axis = Axis(tuple(varied), tuple(zip(*varied.values(), strict=True)))
        self._refuse_repeated(axis, ("sweep", "paired"))
        return axis

    def _refuse_repeated(self, axis: Axis, key: layers.Key) -> None:
        repeated = next((value for index, value in enumerate(axis.values) if value in axis.values[:index]), None)
        if repeated is not None:
            values = " and ".join(map(_shown, repeated))
            self._refuse(key, f"{' and '.join(axis.keys)}: {values} is in the list twice; remove one of them")

    def _varied(
        self, section: Mapping[str, Any], within: layers.Key = ("sweep",), above: layers.Key = ()
    ) -> Iterator[tuple[str, list]]:
        """Yield every dotted key with its values; invalid ones are reported and left out."""
        for name, value in section.items():
            key = (*above, name)
            full = within if within[-1] == "paired" else (*within, *key)
            if key in NOT_VARIED:
                self._refuse(full, f"{'.'.join(key)} cannot be swept: {NOT_VARIED[key]}")
            elif not is_key(key):
                unknown = {"type": "extra_forbidden", "loc": key}
                self._mistakes.append(explain(unknown, {key: self.origin(full)}, self._file))
            elif isinstance(value, Mapping) and section_at(key) is not None and not layers.is_range(value):
                yield from self._varied(value, within, key)
            elif values := self._values(".".join(key), value, full):
                self._swept[".".join(key)] = self.origin(full)
                yield ".".join(key), values

    def _values(self, dotted: str, value: Any, key: layers.Key) -> list[Value]:
        try:
            return _values(value)
        except ValueError as error:
            self._refuse(key, f"{dotted}: {error}")
            return []


def vary(
    data: dict[str, Any], origins: layers.Origins, sweep: Sweep, values: Mapping[str, Value]
) -> tuple[dict[str, Any], layers.Origins]:
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
        changes = layers.merge(changes, layers.nested(key, value))
        layers.set_origin(origins, key, sweep.origins[dotted])
    return layers.merge_with_presets(data, changes), origins


def value_at(scenario: Scenario, data: Mapping[str, Any], key: str) -> Value:
    """Return the value of a dotted key in a setting; None where it has none, or different numbers for the joints.

    Args:
        scenario: the resolved setting.
        data: keys of its scenario file, which name its presets.
        key: dotted key of a scenario file.
    """
    for kind in layers.PRESET_KINDS:
        if key == f"{kind.section}.{kind.key}":
            return kind.name_in(data)
    value: Any = reduce(getattr, key.split("."), scenario)
    if not isinstance(value, Section):
        return value
    numbers = {each for _, each in value}
    return numbers.pop() if len(numbers) == 1 else None


def _values(written: Any) -> list[Value]:
    """Return the values of a list or a range."""
    if isinstance(written, Mapping):
        return _range(dict(written))
    if not isinstance(written, list):
        raise ValueError(f"expected values to sweep over, got {_shown(written)}; {_HOW}")
    values = [_frozen(value) for value in written]
    if not values:
        raise ValueError(f"expected at least one value, got an empty list; {_HOW}")
    return values


def _frozen(value: Any) -> Value:
    if isinstance(value, list):
        return tuple(map(_frozen, value))
    if isinstance(value, str | int | float):
        return value
    raise ValueError(f"expected numbers, words, true, false or lists of them, got {_shown(value)}")


def _range(table: dict[str, Any]) -> list[Value]:
    """Return the values of { from, to, steps, scale }, (steps,)."""
    first, last, steps, scale = (table.pop(key, None) for key in layers.RANGE)
    if table or first is None or last is None or steps is None:
        wrong = f"{', '.join(table)} is not a key of a range" if table else "a range needs from, to and steps"
        raise ValueError(f"{wrong}; {_HOW}")
    for word, value in (("from", first), ("to", last)):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"expected a number for {word}, got {_shown(value)}; {_HOW}")
    if isinstance(steps, bool) or not isinstance(steps, int) or not 2 <= steps <= _MOST_STEPS:
        raise ValueError(f"expected 2 to {_MOST_STEPS} steps, got {_shown(steps)}")
    if scale not in (None, "linear", "log"):
        raise ValueError(f'expected scale = "linear" or "log", got {_shown(scale)}')
    if first == last:
        raise ValueError(f"a range from {first} to {last} is a single value; write a list, [{first}]")
    if scale == "log":
        if first <= 0 or last <= 0:
            raise ValueError(f'a range with scale = "log" needs from and to above 0, got {first} and {last}')
        inner = [first * (last / first) ** (k / (steps - 1)) for k in range(1, steps - 1)]
    else:
        inner = [first + (last - first) * k / (steps - 1) for k in range(1, steps - 1)]
    values = [first, *(float(f"{value:.12g}") for value in inner), last]  # 0.3, not 0.30000000000000004
    whole = isinstance(first, int) and isinstance(last, int)
    return [int(value) if whole and float(value).is_integer() else float(value) for value in values]


def _written(changes: Mapping[str, Any], above: layers.Key = ()) -> Iterator[layers.Key]:
    """Yield the keys that a case changes, down to values and to sections that cannot be varied."""
    for name, value in changes.items():
        key = (*above, name)
        if isinstance(value, Mapping) and value and key not in NOT_VARIED:
            yield from _written(value, key)
        else:
            yield key


def _shown(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=str)
