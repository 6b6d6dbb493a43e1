"""A scenario back to TOML: every key written out, with what it means beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from simharness.scenario.sections.scenario import Scenario


def dumps(scenario: Scenario) -> str:
    """The whole scenario as TOML, defaults included; :func:`simharness.scenario.load.load` reads it back."""
    return "\n".join(_lines(scenario)) + "\n"


def _lines(section: BaseModel, name: str = "", about: str | None = None) -> list[str]:
    head = f"[{name}]"
    lines = [f"{head:<31} # {about}" if about else head] if name else []
    nested: list[str] = []
    for key, field in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, BaseModel):
            nested += ["", *_lines(value, f"{name}.{key}" if name else key, field.description)]
        elif value is not None:
            assignment = f"{key} = {toml(value)}"
            lines.append(f"{assignment:<31} # {field.description}" if field.description else assignment)
    lines += [f"{key} = {toml(value)}" for key, value in (section.model_extra or {}).items()]
    return lines + nested


def toml(value: Any) -> str:
    """A value as TOML writes it on one line: a truth, a number, text, or a list or table of such."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's, but for the one control character that JSON lets stand.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple | list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml(key)} = {toml(each)}" for key, each in value.items()) + "}"
    return repr(value)
