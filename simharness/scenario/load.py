"""Scenario files: TOML in, a checked :class:`Scenario` out, one clear message for each mistake."""

from __future__ import annotations

import difflib
import hashlib
import importlib.metadata
import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from simharness.scenario.models import Scenario

_FILES = (("people", "motion", "file"), ("people", "motion", "skeleton"), ("cameras", "file"))
_SHOWN = 60  # characters of a refused value that a message repeats


class ScenarioError(ValueError):
    """A scenario that cannot be read: every message names the place, the key and how to mend it."""


def load(
    path: Path | str, *, overrides: Sequence[str] = (), seed: int | None = None, folder: Path | None = None
) -> Scenario:
    """Read a scenario file.

    Args:
        path: a TOML file; what its keys mean is written in :mod:`simharness.scenario.models`.
        overrides: ``"people.count=6"``: a dotted key and a TOML value that replaces the file's; a value that
            is not TOML is taken as a bare word, so ``rendering.renderer=gl`` needs no quotes.
        seed: replaces the scenario's seed.
        folder: what files that the scenario file names are relative to; by default its own.

    Raises:
        ScenarioError: a file that is missing or not TOML, a key that does not exist (the nearest one is
            named), or a value of the wrong type or out of range. All mistakes of a file are named at once.
    """
    path = Path(path)
    data = _read(path)
    _locate_files(data, path.parent if folder is None else folder)
    places: dict[tuple[str, ...], str] = {}
    for override in overrides:
        key = _override(data, override)
        places[key] = f"--set {override}"
    if seed is not None:
        data["seed"] = seed
        places["seed",] = "--seed"
    try:
        # Through JSON, for that is where pydantic's strict mode still takes arrays for tuples: count = "4"
        # and count = true are refused, count = 4 and fov = 75 are fine.
        return Scenario.model_validate_json(json.dumps(data, default=str), strict=True)
    except ValidationError as error:
        lines = [_message(mistake, places, str(path)) for mistake in error.errors()]
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


def _read(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ScenarioError(f"{path}: no such file; {_beside(path)}") from None
    except IsADirectoryError:
        raise ScenarioError(f"{path}: is a folder, not a scenario file; {_beside(path / '_')}") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a text file in UTF-8 ({error.reason} at byte {error.start})") from None
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what, line, column = _toml_place(str(error), text)
        raise ScenarioError(f"{path}, line {line}, column {column}: not valid TOML: {what}") from None


def _locate_files(data: dict[str, Any], folder: Path) -> None:
    """Files that a scenario file names are relative to its folder; what the command line names is not."""
    for *sections, key in _FILES:
        section: Any = data
        for name in sections:
            section = section.get(name) if isinstance(section, dict) else None
        if isinstance(section, dict) and isinstance(section.get(key), str) and section[key]:
            section[key] = str(folder / section[key])


def _toml_place(message: str, text: str) -> tuple[str, int, int]:
    """Split tomllib's "what (at line 3, column 5)"; Python 3.11 carries the numbers in the message alone."""
    found = re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", message, re.DOTALL)
    if found:
        return found[1], int(found[2]), int(found[3])
    lines = text.splitlines() or [""]
    return message.removesuffix(" (at end of document)"), len(lines), len(lines[-1]) + 1


def _beside(path: Path) -> str:
    """What scenarios there are in the folder of a path."""
    there = sorted(file.name for file in path.parent.glob("*.toml")) if path.parent.is_dir() else []
    if not there:
        return f"there is no scenario (*.toml) in {path.parent}"
    near = difflib.get_close_matches(path.name, there, n=1)
    hint = f"did you mean {path.parent / near[0]}? " if near else ""
    return f"{hint}{path.parent} has {', '.join(there)}"


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
            what = _toml_place(str(error), "")[0]
            raise ScenarioError(
                f"--set {override}: {written or 'nothing'} is not a TOML value ({what}); "
                """write 6, 0.5, true, word, "some words" or '["walk", "wave"]'"""
            ) from None
        return written
    return parsed["value"] if len(parsed) == 1 else written


def _message(mistake: Mapping[str, Any], places: dict[tuple[str, ...], str], file: str) -> str:
    """One pydantic error as "place: key: what was expected, what was got"."""
    location = tuple(mistake["loc"])
    setters = (  # the last word counts
        place
        for key, place in reversed(places.items())
        if location[: len(key)] == key or key[: len(location)] == location
    )
    place = next(setters, file)
    key = _dotted(location)
    if mistake["type"] == "extra_forbidden":
        return f"{place}: {_unknown(location)}"
    if mistake["type"] == "missing":
        return f"{place}: {key} is missing and has no default; give it a value"
    section = _section(location)
    if mistake["type"] in ("model_type", "model_attributes_type") and section is not None:
        expected = f"a section [{key}] with keys {', '.join(sorted(section.model_fields))}"
    else:
        said = mistake["msg"].replace(" should match ", " should be text that matches ")
        expected = re.sub(r"^(?:\w+ should(?: be| have)?|Value error,) ", "", said)
    field = _field(location)
    about = f" ({field.description})" if field is not None and field.description else ""
    got = json.dumps(mistake["input"], ensure_ascii=False, default=str)
    got = got if len(got) <= _SHOWN else got[: _SHOWN - 1] + "…"
    return f"{place}: {key}{about}: expected {expected}, got {got}"


def _dotted(location: Sequence[str | int]) -> str:
    """``("cameras", "size", 1)`` as ``cameras.size[1]``."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def _unknown(location: Sequence[str | int]) -> str:
    """What to say of a key that does not exist."""
    *parents, wrong = map(str, location)
    section = _section(parents) or Scenario
    valid = sorted(section.model_fields)
    candidates = [".".join([*parents, key]) for key in difflib.get_close_matches(wrong, valid, n=1)]
    # A key of another section, most often one written above its [section] or below the wrong one.
    candidates = candidates or [key for key in _keys(Scenario) if key.rsplit(".", 1)[-1] == wrong]
    hint = f"; did you mean {' or '.join(candidates)}?" if candidates else ";"
    where = f"[{'.'.join(parents)}]" if parents else "a scenario"
    return f"{_dotted(location)} is not a key{hint} {where} has {', '.join(valid)}"


def _keys(section: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Every dotted key of a section and the sections in it."""
    for name, field in section.model_fields.items():
        yield prefix + name
        nested = _nested(field)
        if nested is not None:
            yield from _keys(nested, f"{prefix}{name}.")


def _field(location: Sequence[str | int]) -> FieldInfo | None:
    """The field that a location, or the beginning of it, names."""
    section: type[BaseModel] | None = Scenario
    field = None
    for part in location:
        if section is None:
            break
        field = section.model_fields.get(str(part))
        section = _nested(field)
    return field


def _section(location: Sequence[str | int]) -> type[BaseModel] | None:
    """The section that a location names; None where it names a value or nothing."""
    section: type[BaseModel] | None = Scenario
    for part in location:
        section = None if section is None else _nested(section.model_fields.get(str(part)))
    return section


def _nested(field: FieldInfo | None) -> type[BaseModel] | None:
    """The section that a field holds, if it holds one."""
    kind = None if field is None else field.annotation
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None
