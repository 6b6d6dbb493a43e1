"""Layers of settings: a file over its base, a scenario over its presets, a sweep over a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from simharness.scenario.sections.detector_section import KINDS

Key = tuple[str, ...]
Origins = dict[Key, str]
"""Origin of each key that was set last by something other than the file being read, for messages: ``--set
people.count=6`` for ("people", "count"). Entries are in the order in which keys were set."""

RANGE = ("from", "to", "steps", "scale")
"""Keys of a range of values in a sweep."""


def merge(base: Any, changes: Any) -> Any:
    """Return changes over a base; both stay as they are.

    Sections are merged key by key. Lists and ranges are replaced. A number for all kinds of joints is expanded where
    the changes name single kinds.
    """
    if not isinstance(changes, Mapping) or is_range(changes):
        return changes
    if isinstance(base, int | float) and changes and set(changes) <= set(KINDS):
        base = dict.fromkeys(KINDS, base)
    if not isinstance(base, Mapping):
        return changes
    return {**base, **{key: merge(base.get(key), value) for key, value in changes.items()}}


def is_range(table: Mapping[str, Any]) -> bool:
    """Return whether a table is a range of values, not a section."""
    return any(key in table for key in RANGE)


def nested(key: Key, value: Any) -> dict[str, Any]:
    """Return ``{"people": {"count": 6}}`` for ``("people", "count"), 6``."""
    for part in reversed(key):
        value = {part: value}
    return value


def leaves(data: Mapping[str, Any], above: Key = ()) -> Iterator[Key]:
    """Yield the keys that have a value, in all sections."""
    for name, value in data.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, (*above, name))
        else:
            yield (*above, name)


def set_origin(origins: Origins, key: Key, origin: str) -> None:
    """Record what set a key last."""
    origins.pop(key, None)  # the order of the entries is the order of setting
    origins[key] = origin


def overlap(one: Key, other: Key) -> bool:
    """Return whether two keys are the same, or one is a section that holds the other."""
    shared = min(len(one), len(other))
    return one[:shared] == other[:shared]
