"""[sweep]: the values that keys of a scenario take, and their combinations."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from simharness.scenario.layers import RANGE, Key, Places, is_range, touch
from simharness.scenario.validation_messages import explain, is_key, place_of, section_at

Value = str | int | float | bool | tuple[Any, ...] | None

_MOST_STEPS = 10_000
_HOW = 'write a list, [2, 3, 5], or a range, { from = 0.0, to = 2.0, steps = 5 }, geometric with scale = "log"'
_SEEDS = "say seeds = 20, or a list of seeds, at the top of the file"
_NAMES = "name what differs by [cases.NAME] with the keys that it changes"
_VARIANTS = 'say variants = ["full", "fast"] at the top of the file: all of them see the same detections'
NOT_VARIED: dict[Key, str] = {
    ("seed",): _SEEDS,
    ("seeds",): _SEEDS,
    ("name",): _NAMES,
    ("description",): _NAMES,
    ("variants",): _VARIANTS,
    ("method", "variants"): _VARIANTS,
    ("method", "estimators"): _VARIANTS,
    ("extends",): "a study has one base; make a study of each file",
    ("gate",): "a study has one gate",
    ("sweep",): "a study has one [sweep]",
    ("cases",): "a study has one table of [cases]",
}


@dataclass(frozen=True)
class Axis:
    """Keys whose values go together; most often one key.

    Attributes:
        keys: dotted, (k,).
        values: of the keys, (steps, k).
    """

    keys: tuple[str, ...]
    values: tuple[tuple[Value, ...], ...]

    def others(self, base: Mapping[str, Value]) -> list[tuple[Value, ...]]:
        """The values that are not the base's."""
        there = tuple(base[key] for key in self.keys)
        return [values for values in self.values if values != there]


@dataclass(frozen=True)
class Sweep:
    """What is varied.

    Attributes:
        axes: in the order of the file.
        one_at_a_time: the base, and every axis by itself; else every combination.
        places: who said the values of a dotted key, for messages.
    """

    axes: tuple[Axis, ...] = ()
    one_at_a_time: bool = False
    places: Mapping[str, str] = field(default_factory=dict)

    @property
    def keys(self) -> tuple[str, ...]:
        """All dotted keys."""
        return tuple(key for axis in self.axes for key in axis.keys)

    def count(self, base: Mapping[str, Value]) -> int:
        """How many settings :meth:`settings` gives, without making them."""
        if self.one_at_a_time:
            return 1 + sum(len(axis.others(base)) for axis in self.axes)
        return math.prod(len(axis.values) for axis in self.axes)

    def settings(self, base: Mapping[str, Value]) -> Iterator[tuple[str, dict[str, Value]]]:
        """Which key is varied, "" for the base and for combinations, and the values of all keys that change.

        Args:
            base: the values of all swept keys where they are not varied.
        """
        if self.one_at_a_time:
            yield "", {}
            for axis in self.axes:
                for values in axis.others(base):
                    yield axis.keys[0], dict(zip(axis.keys, values, strict=True))
        else:
            for combination in itertools.product(*(axis.values for axis in self.axes)):
                yield "", dict(zip(self.keys, itertools.chain(*combination), strict=True))


class SweepReader:
    """Reads [sweep] and [cases] and notes all that is wrong with them."""

    def __init__(self, places: Places, file: str, mistakes: list[str]) -> None:
        """Read what ``file`` says, of which ``places`` knows who set what; append to ``mistakes``."""
        self.places = places
        self._file = file
        self._mistakes = mistakes
        self._said: dict[str, str] = {}

    def sweep(self, said: Any) -> Sweep:
        """What [sweep] says."""
        if not isinstance(said, Mapping):
            self._refuse(("sweep",), f"sweep: expected a section [sweep] with keys of a scenario, got {_shown(said)}")
            return Sweep()
        said = dict(said)
        one_at_a_time = said.pop("one_at_a_time", False)
        if not isinstance(one_at_a_time, bool):
            self._refuse(("sweep", "one_at_a_time"), f"one_at_a_time: expected true, got {_shown(one_at_a_time)}")
        paired = said.pop("paired", [])
        axes = [Axis((dotted,), tuple((value,) for value in values)) for dotted, values in self._varied(said)]
        for axis in axes:
            self._refuse_repeated(axis, ("sweep", *axis.keys[0].split(".")))
        if isinstance(paired, list) and all(isinstance(table, Mapping) for table in paired):
            axes += filter(None, map(self._pair, paired))
        else:
            self._refuse(("sweep", "paired"), f"paired: expected tables [[sweep.paired]], got {_shown(paired)}")
        keys = [tuple(key.split(".")) for axis in axes for key in axis.keys]
        for index, key in enumerate(keys):
            if clash := next((other for other in keys[:index] if touch(key, other)), None):
                also = "" if clash == key else f", for {'.'.join(clash)} is"
                self._refuse(("sweep", *key), f"{'.'.join(key)} is swept twice{also}; take one out")
        return Sweep(tuple(axes), one_at_a_time is True, self._said)

    def cases(self, said: Any, sweep: Sweep) -> dict[str, dict[str, Any]]:
        """The changes of every case of [cases]."""
        if not isinstance(said, Mapping) or not all(isinstance(changes, Mapping) for changes in said.values()):
            expected = "expected a section [cases.NAME] with the keys that it changes for each case"
            self._refuse(("cases",), f"cases: {expected}, got {_shown(said)}")
            return {}
        swept = [tuple(key.split(".")) for key in sweep.keys]
        for name, changes in said.items():
            if not name or not set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789_-"):
                expected = "expected a name of small letters, digits, - and _"
                self._refuse(("cases", name), f"cases.{name}: {expected}")
            for key in _written(changes):
                dotted = ".".join(key)
                if key in NOT_VARIED or key[:1] in NOT_VARIED:
                    how = NOT_VARIED.get(key) or NOT_VARIED[key[:1]]
                    self._refuse(("cases", name, *key), f"{dotted} is nothing for a case: {how}")
                elif any(touch(key, other) for other in swept):
                    self._refuse(("cases", name, *key), f"{dotted} is swept, too; take it out of the case or the sweep")
        return {name: dict(changes) for name, changes in said.items()}

    def place(self, key: Key) -> str:
        """Who said a key of [sweep] or [cases], as messages begin."""
        place = place_of(key, self.places, self._file)
        section = "sweep" if key[0] == "sweep" else ".".join(key[:2])
        return place if place.startswith("--") else f"{place}, [{section}]"

    def _refuse(self, key: Key, message: str) -> None:
        self._mistakes.append(f"{self.place(key)}: {message}")

    def _pair(self, table: Mapping[str, Any]) -> Axis | None:
        varied = dict(self._varied(table, ("sweep", "paired")))
        lengths = {key: len(values) for key, values in varied.items()}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{key} has {length}" for key, length in lengths.items())
            self._refuse(("sweep", "paired"), f"lists of [[sweep.paired]] go together and must be as long: {counts}")
            return None
        if not varied:
            return None
        axis = Axis(tuple(varied), tuple(zip(*varied.values(), strict=True)))
        self._refuse_repeated(axis, ("sweep", "paired"))
        return axis

    def _refuse_repeated(self, axis: Axis, key: Key) -> None:
        repeated = next((value for index, value in enumerate(axis.values) if value in axis.values[:index]), None)
        if repeated is not None:
            shown = " and ".join(map(_shown, repeated))
            self._refuse(key, f"{' and '.join(axis.keys)}: {shown} is in the list twice; take one out")

    def _varied(self, said: Mapping[str, Any], within: Key = ("sweep",), above: Key = ()) -> Iterator[tuple[str, list]]:
        """Every dotted key with its values; those that are wrong are refused and left out."""
        for name, value in said.items():
            key = (*above, name)
            place = within if within[-1] == "paired" else (*within, *key)
            if key in NOT_VARIED:
                self._refuse(place, f"{'.'.join(key)} is not swept: {NOT_VARIED[key]}")
            elif not is_key(key):
                unknown = {"type": "extra_forbidden", "loc": key}
                self._mistakes.append(explain(unknown, {key: self.place(place)}, self._file))
            elif isinstance(value, Mapping) and section_at(key) is not None and not is_range(value):
                yield from self._varied(value, within, key)
            elif values := self._values(".".join(key), value, place):
                self._said[".".join(key)] = self.place(place)
                yield ".".join(key), values

    def _values(self, dotted: str, said: Any, place: Key) -> list[Value]:
        try:
            return _values(said)
        except ValueError as error:
            self._refuse(place, f"{dotted}: {error}")
            return []


def _values(said: Any) -> list[Value]:
    """The values that a list or a range means."""
    if isinstance(said, Mapping):
        return _range(dict(said))
    if not isinstance(said, list):
        raise ValueError(f"expected values to sweep over, got {_shown(said)}; {_HOW}")
    values = [_frozen(value) for value in said]
    if not values:
        raise ValueError(f"an empty list sweeps over nothing; {_HOW}")
    return values


def _frozen(value: Any) -> Value:
    if isinstance(value, list):
        return tuple(map(_frozen, value))
    if isinstance(value, str | int | float):
        return value
    raise ValueError(f"expected numbers, words, true, false or lists of them, got {_shown(value)}")


def _range(said: dict[str, Any]) -> list[Value]:
    """The values of { from, to, steps, scale }, (steps,)."""
    first, last, steps, scale = (said.pop(word, None) for word in RANGE)
    if said or first is None or last is None or steps is None:
        wrong = f"{', '.join(said)} is no word of a range" if said else "a range has from, to and steps"
        raise ValueError(f"{wrong}; {_HOW}")
    for word, value in (("from", first), ("to", last)):
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"expected a number for {word}, got {_shown(value)}; {_HOW}")
    if isinstance(steps, bool) or not isinstance(steps, int) or not 2 <= steps <= _MOST_STEPS:
        raise ValueError(f"expected 2 to {_MOST_STEPS} steps, got {_shown(steps)}")
    if scale not in (None, "linear", "log"):
        raise ValueError(f'expected scale = "linear" or "log", got {_shown(scale)}')
    if first == last:
        raise ValueError(f"a range from {first} to {last} is one value; write a list, [{first}]")
    if scale == "log":
        if first <= 0 or last <= 0:
            raise ValueError(f'a range with scale = "log" needs from and to above 0, got {first} and {last}')
        inner = [first * (last / first) ** (k / (steps - 1)) for k in range(1, steps - 1)]
    else:
        inner = [first + (last - first) * k / (steps - 1) for k in range(1, steps - 1)]
    values = [first, *(float(f"{value:.12g}") for value in inner), last]  # 0.3, not 0.30000000000000004
    whole = isinstance(first, int) and isinstance(last, int)
    return [int(value) if whole and float(value).is_integer() else float(value) for value in values]


def _written(changes: Mapping[str, Any], above: Key = ()) -> Iterator[Key]:
    """The keys that a case changes, down to values and to sections that a study has one of."""
    for name, value in changes.items():
        key = (*above, name)
        if isinstance(value, Mapping) and value and key not in NOT_VARIED:
            yield from _written(value, key)
        else:
            yield key


def _shown(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=str)
