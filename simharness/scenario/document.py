"""Document: a scenario file joined with the files that it extends and the overrides of the command line.

Paths in scenario files are relative to the folder of the file; on the command line, to the working directory.
"""

import difflib
import os
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mvpose.files.input_files import parse_toml
from mvpose.files.message_text import one_line, shown
from simharness.scenario.layers import PRESET_KINDS, Key, Origins, leaves, merge_with_presets, set_origin
from simharness.scenario.sections.method_section import module_file
from simharness.scenario.sections.scenario import FILE_KEYS, NETWORK_KEYS
from simharness.scenario.shipped import shipped_folder, shipped_names
from simharness.scenario.toml_files import ScenarioError, read_toml, toml_place

_PRESET_KEYS = tuple((kind.section, kind.key) for kind in PRESET_KINDS)  # TOML files or names
_ESTIMATORS = ("method", "estimators")  # "FILE.py:ATTRIBUTE" or "PACKAGE.MODULE:ATTRIBUTE", by name


@dataclass(frozen=True)
class Document:
    """Keys of a scenario file and its bases, before presets are resolved."""

    path: Path
    """The file."""
    data: dict[str, Any]
    """Keys of the file, of its bases and of the command line; ``variants`` is written as ``method.variants``."""
    origins: Origins
    """Origin of each key, a file or the command line."""
    folders: tuple[Path, ...]
    """Folders of the file and its bases, in which presets are looked for."""


def find_scenario(name: Path | str, *, folder: Path = Path(), extended_by: Path | None = None) -> Path:
    """Return the file of a scenario.

    Args:
        name: a path, relative to ``folder``, or a bare name such as "quickstart": a file of this name, with or without
            ``.toml``, in ``folder``, or else a shipped scenario.
        folder: folder of relative paths; by default the working directory.
        extended_by: the file whose ``extends`` names the scenario; it cannot extend itself by its bare name.

    Raises:
        ScenarioError: no scenario has this bare name, or a shipped one is named by the path of a missing file.
    """
    path, text = folder / name, str(name)
    if Path(text).name != text or text.endswith(".toml"):
        if not os.path.exists(path) and path.stem in shipped_names():
            raise ScenarioError(
                f"{path}: no such file; did you mean {path.stem}? Shipped scenarios are named without folder and .toml"
            )
        return path
    for file in (path, path.with_name(f"{path.name}.toml"), shipped_folder() / f"{text}.toml"):
        if os.path.isfile(file) and (extended_by is None or file.resolve() != extended_by.resolve()):
            return file
    if os.path.isdir(path):
        return path  # for the message of the reader
    names = shipped_names()
    near = difflib.get_close_matches(text, names, n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    raise ScenarioError(
        f"{text}: no such scenario; {hint}expected a TOML file, or the name of a shipped scenario: {', '.join(names)}"
    )


def read_document(path: Path | str, *, overrides: Sequence[str] = (), folder: Path | None = None) -> Document:
    """Read a scenario file and the files that it extends.

    Args:
        path: the file, or the name of a shipped scenario.
        overrides: as in :func:`simharness.scenario.load.load`.
        folder: folder to which files named in the scenario file are relative; by default that of the file.

    Raises:
        ScenarioError: a file that does not exist or is not TOML, files that extend each other in a circle, or an
            override that is not KEY=VALUE.
    """
    path = find_scenario(path)
    chain = _read_chain(path)
    data: dict[str, Any] = {}
    origins: Origins = {}
    for file, keys in reversed(chain):
        locate_files(keys, file.parent if folder is None or file is not path else folder)
        short = "variants" in keys
        _move_variants(keys, file)
        for key, _ in leaves(keys):
            set_origin(origins, key, str(file))
        if short:  # messages name the key as it is written
            set_origin(origins, ("variants",), str(file))
        data = merge_with_presets(data, keys)
    data = _override(data, overrides, origins)
    return Document(path, data, origins, tuple(dict.fromkeys(file.parent for file, _ in chain)))


def _read_chain(path: Path) -> list[tuple[Path, dict[str, Any]]]:
    """Return the file, its base, the base of that, ..., each with its keys."""
    chain: list[tuple[Path, dict[str, Any]]] = []
    file: Path | None = path
    while file is not None:
        try:
            keys = read_toml(file)
        except ScenarioError as error:
            raise ScenarioError(f"{chain[-1][0]}: extends: {error}" if chain else str(error)) from None
        chain.append((file, keys))
        base = keys.pop("extends", "")
        if not isinstance(base, str):
            got = shown(base)
            raise ScenarioError(f"{file}: extends: expected a scenario file or the name of a shipped one, got {got}")
        try:
            file = find_scenario(base, folder=file.parent, extended_by=file) if base else None
        except ScenarioError as error:
            raise ScenarioError(f"{file}: extends: {error}") from None
        if file is not None and file.resolve() in [each.resolve() for each, _ in chain]:
            names = " extends ".join(str(each) for each in [*(each for each, _ in chain), file])
            raise ScenarioError(f"{names}: files cannot extend each other in a circle; remove one extends")
    return chain


def _move_variants(keys: dict[str, Any], file: Path) -> None:
    """Rename ``variants`` to ``method.variants``, in place."""
    if "variants" not in keys:
        return
    method = keys.setdefault("method", {})
    if not isinstance(method, dict):
        return
    if "variants" in method:
        raise ScenarioError(f"{file}: variants and method.variants are the same key; remove one of them")
    method["variants"] = keys.pop("variants")


def _override(data: dict[str, Any], overrides: Sequence[str], origins: Origins) -> dict[str, Any]:
    """Return the keys of a file, with those of the command line in their place.

    Args:
        data: keys of the file; changed in place.
        overrides: "people.count=6": a dotted key and a TOML value, or a bare word.
        origins: origins of the keys; those of the command line are added.
    """
    parsed = [_parse_override(override) for override in overrides]
    for kind in PRESET_KINDS:  # presets first, so that all other overrides change the chosen preset
        chosen = [value for key, value in parsed if key == (kind.section, kind.key)]
        if chosen:
            data = merge_with_presets(data, {kind.section: {kind.key: chosen[-1]}})
    for override, (key, value) in zip(overrides, parsed, strict=True):
        section = data
        for depth, part in enumerate(key[:-1], start=1):
            section = section.setdefault(part, {})
            if not isinstance(section, dict):
                raise ScenarioError(f"--set {override}: {'.'.join(key[:depth])} is a value, not a section")
        section[key[-1]] = value
        set_origin(origins, key, f"--set {override}")
        if override.partition("=")[0].strip() == "variants":  # messages name the key as it is written
            set_origin(origins, ("variants",), f"--set {override}")
    return data


def _parse_override(override: str) -> tuple[Key, Any]:
    dotted, sign, written = override.partition("=")
    key = tuple(part.strip() for part in dotted.split("."))
    if not sign or not all(key):
        raise ScenarioError(f"--set {override}: expected KEY=VALUE, for example --set people.count=6")
    if key[0] == "extends":
        raise ScenarioError(f"--set {override}: extends cannot be set; run the file that it would name")
    return ("method", "variants") if key == ("variants",) else key, _parse_value(override, written.strip())


def _parse_value(override: str, written: str) -> Any:
    """Return a TOML value, or a bare word as text."""
    try:
        parsed = parse_toml(f"value = {written}")
    except tomllib.TOMLDecodeError as error:
        if not written or written[0] in "[{\"'":  # meant as TOML: a message is better than a strange text
            what = toml_place(str(error), "")[0]
            raise ScenarioError(
                f"--set {one_line(override, 100)}: {one_line(written, 60) or 'nothing'} is not a TOML value ({what}); "
                """write 6, 0.5, true, word, "some words" or '["walk", "wave"]'"""
            ) from None
        return written
    except ValueError as error:
        raise ScenarioError(f"--set {one_line(override, 100)}: {error}") from None
    return parsed["value"] if len(parsed) == 1 else written


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
    if key[:-1] == _ESTIMATORS and isinstance(value, str) and (file := module_file(value, folder)) is not None:
        return f"{file}:{value.rpartition(':')[2]}"
    return str(folder / value) if _is_file(key, value) else value


def _is_file(key: Key, value: Any) -> bool:
    if not isinstance(value, str) or not value:
        return False
    if key in _PRESET_KEYS:
        return value.endswith(".toml")
    if key in NETWORK_KEYS:
        return "/" in value or value.endswith(".onnx")
    return key in FILE_KEYS or ".py:" in value
