"""Settings over settings: what a file says over its base, a scenario over its presets, a sweep over a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from simharness.scenario.sections.detector import KINDS

Key = tuple[str, ...]
Places = dict[Key, str]
"""Who set a key where it is not the file that is read: ``--set people.count=6`` for ("people", "count")."""

RANGE = ("from", "to", "steps", "scale")
"""The words of a range in a sweep."""


def over(base: Any, said: Any) -> Any:
    """What is said over what was, both left as they are.

    Sections go key by key, lists and ranges are replaced, a number for all joints gives way joint by joint.
    """
    if not isinstance(said, Mapping) or is_range(said):
        return said
    if isinstance(base, int | float) and said and set(said) <= set(KINDS):
        base = dict.fromkeys(KINDS, base)
    if not isinstance(base, Mapping):
        return said
    return {**base, **{key: over(base.get(key), value) for key, value in said.items()}}


def is_range(said: Mapping[str, Any]) -> bool:
    """Whether a table is a range of values, and no section."""
    return any(word in said for word in RANGE)


def nested(key: Key, value: Any) -> dict[str, Any]:
    """``("people", "count"), 6`` as ``{"people": {"count": 6}}``."""
    for part in reversed(key):
        value = {part: value}
    return value


def leaves(data: Mapping[str, Any], above: Key = ()) -> Iterator[Key]:
    """The keys that have a value in some settings."""
    for name, value in data.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, (*above, name))
        else:
            yield (*above, name)


def set_place(places: Places, key: Key, place: str) -> None:
    """Note who set a key last."""
    places.pop(key, None)  # places are in the order in which keys were set
    places[key] = place


def touch(one: Key, other: Key) -> bool:
    """Whether two keys are the same, or one is a section that holds the other."""
    shared = min(len(one), len(other))
    return one[:shared] == other[:shared]
