"""Scenario files: TOML in, a checked :class:`Scenario` out, one clear message for each mistake."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from simharness.scenario.mistakes import explain
from simharness.scenario.models import Scenario
from simharness.scenario.profiles import take_profile
from simharness.scenario.reading import ScenarioError, read_toml, toml_place

_FILES = (
    ("people", "motion", "file"),
    ("people", "motion", "skeleton"),
    ("cameras", "file"),
    ("detector", "onnx"),
    ("appearance", "network"),
)


def load(
    path: Path | str, *, overrides: Sequence[str] = (), seed: int | None = None, folder: Path | None = None
) -> Scenario:
    """Read a scenario file.

    Args:
        path: a TOML file; what its keys mean is written in :mod:`simharness.scenario.models`. Its detector begins
            with the profile that it names, "typical" if none.
        overrides: ``"people.count=6"``: a dotted key and a TOML value that replaces the file's; a value that
            is not TOML is taken as a bare word, so ``rendering.renderer=gl`` needs no quotes.
        seed: replaces the scenario's seed.
        folder: what files that the scenario file names are relative to; by default its own.

    Raises:
        ScenarioError: a file that is missing or not TOML, a key that does not exist (the nearest one is
            named), or a value of the wrong type or out of range. All mistakes of a file are named at once.
    """
    path = Path(path)
    data = read_toml(path)
    _locate_files(data, path.parent if folder is None else folder)
    places: dict[tuple[str, ...], str] = {}
    for override in overrides:
        key = _override(data, override)
        places[key] = f"--set {override}"
    take_profile(data, path.parent, places)
    if seed is not None:
        data["seed"] = seed
        places["seed",] = "--seed"
    try:
        # Through JSON, for that is where pydantic's strict mode still takes arrays for tuples: count = "4"
        # and count = true are refused, count = 4 and fov = 75 are fine.
        return Scenario.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        lines = [explain(mistake, places, str(path)) for mistake in error.errors()]
        raise ScenarioError("\n".join(dict.fromkeys(lines))) from None


def fingerprint(scenario: Scenario) -> str:
    """Ten hexadecimal digits that change with any value of the scenario, its files and the version of the code."""
    resolved = json.dumps({"code": code_version(), "scenario": scenario.model_dump(mode="json")}, sort_keys=True)
    digest = hashlib.blake2b(resolved.encode(), digest_size=5)
    for file in scenario.files:
        digest.update(file.read_bytes() if file.is_file() else b"")
    return digest.hexdigest()


def code_version() -> str:
    """The version of the installed package."""
    return importlib.metadata.version("simharness")


def _locate_files(data: dict[str, Any], folder: Path) -> None:
    """Files that a scenario file names are relative to its folder; what the command line names is not."""
    for *sections, key in _FILES:
        section: Any = data
        for name in sections:
            section = section.get(name) if isinstance(section, dict) else None
        if isinstance(section, dict) and isinstance(section.get(key), str) and section[key]:
            section[key] = str(folder / section[key])


def _override(data: dict[str, Any], override: str) -> tuple[str, ...]:
    """Write one ``key=value`` into the data; return its key."""
    dotted, sign, written = override.partition("=")
    key = tuple(part.strip() for part in dotted.split("."))
    if not sign or not all(key):
        raise ScenarioError(f"--set {override}: expected KEY=VALUE, for example --set people.count=6")
    section = data
    for depth, part in enumerate(key[:-1], start=1):
        section = section.setdefault(part, {})
        if not isinstance(section, dict):
            raise ScenarioError(f"--set {override}: {'.'.join(key[:depth])} is a value, not a section")
    section[key[-1]] = _value(override, written.strip())
    return key


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
