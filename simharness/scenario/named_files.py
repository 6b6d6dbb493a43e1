"""Files that a scenario file names are relative to its folder; what the command line names is not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

_FILES = (
    ("people", "motion", "file"),
    ("people", "motion", "skeleton"),
    ("cameras", "file"),
    ("detector", "onnx"),
    ("appearance", "network"),
)
_FILES_OR_NAMES = (("cameras", "rig"), ("detector", "profile"))
_ESTIMATORS = ("method", "estimators")  # "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE", by name

Key = tuple[str, ...]


def locate_files(data: dict[str, Any], folder: Path) -> None:
    """Write the folder before the files that a scenario, its cases and its sweep name, in place."""
    for settings in _settings(data):
        for key, value in list(_named(settings)):
            section = _section(settings, key[:-1])
            assert section is not None
            section[key[-1]] = _located(key, value, folder)


def relative_files(settings: dict[str, Any]) -> Iterator[tuple[Key, str]]:
    """The keys of a scenario that name files by paths that are not absolute, and those paths."""
    for key, value in _named(settings):
        if _is_file(key, value) and not Path(value).is_absolute():
            yield key, value


def _settings(data: dict[str, Any]) -> Iterator[Any]:
    """Whatever may have the keys of a scenario."""
    yield data
    cases, sweep = data.get("cases"), data.get("sweep")
    if isinstance(cases, dict):
        yield from cases.values()
    if isinstance(sweep, dict):
        yield sweep
        if isinstance(sweep.get("paired"), list):
            yield from sweep["paired"]


def _named(settings: Any) -> Iterator[tuple[Key, Any]]:
    """The keys of some settings that may name files, and what they say."""
    for key in (*_FILES, *_FILES_OR_NAMES):
        section = _section(settings, key[:-1])
        if section is not None and key[-1] in section:
            yield key, section[key[-1]]
    for name, place in (_section(settings, _ESTIMATORS) or {}).items():
        yield (*_ESTIMATORS, name), place


def _section(settings: Any, names: Sequence[str]) -> dict[str, Any] | None:
    """A section of some settings; None where they have none."""
    for name in names:
        settings = settings.get(name) if isinstance(settings, dict) else None
    return settings if isinstance(settings, dict) else None


def _located(key: Key, value: Any, folder: Path) -> Any:
    if isinstance(value, list):  # of a sweep
        return [_located(key, each, folder) for each in value]
    return str(folder / value) if _is_file(key, value) else value


def _is_file(key: Key, value: Any) -> bool:
    if not isinstance(value, str) or not value:
        return False
    if key in _FILES_OR_NAMES:
        return value.endswith(".toml")
    return key in _FILES or ".py:" in value
