"""``--set KEY=VALUE``: keys of a scenario file that the command line replaces."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from typing import Any

from simharness.scenario.layers import Key, Places, set_place
from simharness.scenario.presets import KINDS, layered
from simharness.scenario.toml_reader import ScenarioError, toml_place


def overridden(data: dict[str, Any], overrides: Sequence[str], places: Places) -> dict[str, Any]:
    """The settings of a file with those of the command line in their place.

    Args:
        data: of the file; changed in place.
        overrides: ``"people.count=6"``: a dotted key and a TOML value, or a bare word.
        places: who set a key; those of the command line are added.

    Raises:
        ScenarioError: what is not KEY=VALUE, or a key below a value.
    """
    parsed = [_parsed(override) for override in overrides]
    for kind in KINDS:  # first: whatever else is set changes the preset
        chosen = [value for key, value in parsed if key == (kind.section, kind.key)]
        if chosen:
            data = layered(data, {kind.section: {kind.key: chosen[-1]}})
    for override, (key, value) in zip(overrides, parsed, strict=True):
        section = data
        for depth, part in enumerate(key[:-1], start=1):
            section = section.setdefault(part, {})
            if not isinstance(section, dict):
                raise ScenarioError(f"--set {override}: {'.'.join(key[:depth])} is a value, not a section")
        section[key[-1]] = value
        set_place(places, key, f"--set {override}")
        if override.partition("=")[0].strip() == "variants":  # as it is written, for messages
            set_place(places, ("variants",), f"--set {override}")
    return data


def _parsed(override: str) -> tuple[Key, Any]:
    dotted, sign, written = override.partition("=")
    key = tuple(part.strip() for part in dotted.split("."))
    if not sign or not all(key):
        raise ScenarioError(f"--set {override}: expected KEY=VALUE, for example --set people.count=6")
    if key[0] == "extends":
        raise ScenarioError(f"--set {override}: extends stands in files alone; run the file that it would name")
    return ("method", "variants") if key == ("variants",) else key, _value(override, written.strip())


def _value(override: str, written: str) -> Any:
    """A TOML value, or a bare word."""
    try:
        parsed = tomllib.loads(f"value = {written}")
    except tomllib.TOMLDecodeError as error:
        if not written or written[0] in "[{\"'":  # meant as TOML: better a message than a strange string
            what = toml_place(str(error), "")[0]
            raise ScenarioError(
                f"--set {override}: {written or 'nothing'} is not a TOML value ({what}); "
                """write 6, 0.5, true, word, "some words" or '["walk", "wave"]'"""
            ) from None
        return written
    return parsed["value"] if len(parsed) == 1 else written
