"""Files that a scenario file names are relative to its folder; what the command line names is not."""

from __future__ import annotations

from collections.abc import Iterator
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


def locate_files(data: dict[str, Any], folder: Path) -> None:
    """Write the folder before the files that a scenario, its cases and its sweep name, in place."""
    for settings in _settings(data):
        for *sections, key in (*_FILES, *_FILES_OR_NAMES):
            section: Any = settings
            for name in sections:
                section = section.get(name) if isinstance(section, dict) else None
            if isinstance(section, dict) and key in section:
                section[key] = _located(section[key], folder, named=(*sections, key) in _FILES_OR_NAMES)


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


def _located(value: Any, folder: Path, *, named: bool) -> Any:
    if isinstance(value, list):  # of a sweep
        return [_located(each, folder, named=named) for each in value]
    if not isinstance(value, str) or not value or (named and not value.endswith(".toml")):
        return value
    return str(folder / value)
