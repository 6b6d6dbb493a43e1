"""A study back to TOML, as it was run: its file with the bases and the command line in it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from simharness.scenario.layers import RANGE
from simharness.scenario.study_definition import Study


def document(study: Study) -> str:
    """A scenario file that makes the same study: :func:`simharness.scenario.study_definition.load_study` reads it.

    What it extended is in it; rigs and detectors are by name, and other files relative to where the study was started.
    """
    said = {key: value for key, value in study.said.items() if key not in ("seed", "seeds", "method")}
    head: dict[str, Any] = {"name": study.name, "seeds": list(study.seeds), "variants": list(study.variants)}
    if own := study.base.method.estimators.places:
        said["method"] = {"estimators": own}
    return "\n".join(_lines({**head, **said})) + "\n"


def _lines(table: Mapping[str, Any], name: str = "") -> Iterator[str]:
    sections = {key: value for key, value in table.items() if _is_section(value)}
    if name and (len(sections) < len(table) or not table):
        yield f"\n[{name}]"
    for key, value in table.items():
        if key not in sections:
            yield f"{key} = {_written(value)}"
    for key, section in sections.items():
        yield from _lines(section, f"{name}.{key}" if name else key)


def _is_section(value: Any) -> bool:
    """A range of values is none: it is better read in one line."""
    return isinstance(value, Mapping) and not set(RANGE) & set(value)


def _written(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_written(each)}" for key, each in _flat(value)) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_written, value)) + "]"
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for the one control character that JSON lets stand.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return json.dumps(value)


def _flat(table: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys, for within braces."""
    for key, value in table.items():
        if _is_section(value):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value
