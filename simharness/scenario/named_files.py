"""Paths in scenario files: relative to the folder of the file; on the command line, to the working directory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from simharness.scenario.layers import Key
from simharness.scenario.sections.scenario import FILE_KEYS

_PRESET_KEYS = (("cameras", "rig"), ("sensor", "profile"), ("detector", "profile"))  # TOML files or names
_ESTIMATORS = ("method", "estimators")  # "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE", by name


def locate_files(data: dict[str, Any], folder: Path) -> None:
    """Prefix the files that a scenario, its cases and its sweep name with a folder, in place."""
    for settings in _settings(data):
        for key, value in list(_file_values(settings)):
            section = _section(settings, key[:-1])
            assert section is not None
            section[key[-1]] = _located(key, value, folder)


def relative_files(settings: dict[str, Any]) -> Iterator[tuple[Key, str]]:
    """Yield the keys of a scenario that name files by relative paths, and those paths."""
    for key, values in _file_values(settings):
        for value in values if isinstance(values, list) else [values]:
            if _is_file(key, value) and not Path(value).is_absolute():
                yield key, value


def _settings(data: dict[str, Any]) -> Iterator[Any]:
    """Yield all parts of a file that may have keys of a scenario."""
    yield data
    cases, sweep = data.get("cases"), data.get("sweep")
    if isinstance(cases, dict):
        yield from cases.values()
    if isinstance(sweep, dict):
        yield sweep
        if isinstance(sweep.get("paired"), list):
            yield from sweep["paired"]


def _file_values(settings: Any) -> Iterator[tuple[Key, Any]]:
    """Yield the keys that may name files, and their values."""
    for key in (*FILE_KEYS, *_PRESET_KEYS):
        section = _section(settings, key[:-1])
        if section is not None and key[-1] in section:
            yield key, section[key[-1]]
    for name, place in (_section(settings, _ESTIMATORS) or {}).items():
        yield (*_ESTIMATORS, name), place


def _section(settings: Any, names: Sequence[str]) -> dict[str, Any] | None:
    """Return a section; None where it is absent or not a table."""
    for name in names:
        settings = settings.get(name) if isinstance(settings, dict) else None
    return settings if isinstance(settings, dict) else None


def _located(key: Key, value: Any, folder: Path) -> Any:
    if isinstance(value, list):  # of files, or of a sweep
        return [_located(key, each, folder) for each in value]
    return str(folder / value) if _is_file(key, value) else value


def _is_file(key: Key, value: Any) -> bool:
    if not isinstance(value, str) or not value:
        return False
    if key in _PRESET_KEYS:
        return value.endswith(".toml")
    return key in FILE_KEYS or ".py:" in value
