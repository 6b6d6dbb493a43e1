"""Presets of a section: rigs, sensor profiles and detector profiles, files of settings that scenarios name.

``[detector] profile = "typical"`` takes ``scenarios/detectors/typical.toml``, ``[sensor] profile = "webcam"`` takes
``scenarios/sensors/webcam.toml`` and ``[cameras] rig = "dome12"`` takes ``scenarios/rigs/dome12.toml``: from a folder
``detectors``, ``sensors`` or ``rigs`` beside the scenario, or else from the shipped scenarios. Other keys of the
section change the preset. A preset may begin with another preset by the same key.
"""

import difflib
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from mvpose.files.input_files import SETTINGS, read_bytes
from mvpose.files.message_text import all_in_one_line, listed, shown
from simharness.scenario.document import locate_files
from simharness.scenario.layers import PRESET_KINDS, PROFILES, Origins, PresetKind, merge
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.toml_files import ScenarioError, read_toml
from simharness.scenario.validation_messages import explain_all


def file_of(kind: PresetKind, name: str, folders: Sequence[Path], *, near: Path = Path()) -> Path:
    """Return the file of a preset.

    Args:
        kind: kind of preset.
        name: name of a preset, or path of a TOML file.
        folders: folders searched before the shipped one, each with its subfolder of the kind.
        near: folder to which the path of a TOML file is relative.

    Raises:
        ScenarioError: no preset has this name.
    """
    if name.endswith(".toml"):
        return near / name
    searched = [folder if folder.name == kind.folder else folder / kind.folder for folder in folders] + [kind.shipped]
    for folder in searched:
        if os.path.isfile(folder / f"{name}.toml"):  # False for a name that cannot be one of a file
            return folder / f"{name}.toml"
    known = sorted({file.stem for folder in searched for file in folder.glob("*.toml")})
    near_names = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {near_names[0]}?" if near_names else ""
    raise ScenarioError(
        f"{kind.section}.{kind.key} = {shown(name)}: no such {kind.key}; expected one of "
        f"{listed(known, 20) or 'none'}, or a file that ends in .toml.{hint}"
    )


def read_preset(kind: PresetKind, path: Path, *, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Return the settings of a preset's file, merged over those of the preset with which it begins.

    Args:
        kind: kind of preset.
        path: its file.
        above: files that begin with this one.

    Raises:
        ScenarioError: the file cannot be read, begins with itself, or has a key or value that the section refuses.
    """
    if path in above:
        raise ScenarioError(
            f"{path}: begins with {kind.key} {above[-1].stem!r}, which begins with it; remove one {kind.key}"
        )
    settings = read_toml(path)
    begins = settings.pop(kind.key, "")
    locate_files({kind.section: settings}, path.parent)
    if not isinstance(begins, str):
        raise ScenarioError(f"{path}: {kind.key}: expected the name of a {kind.title}, got {shown(begins)}")
    if begins:
        base = read_preset(kind, file_of(kind, begins, [path.parent], near=path.parent), above=(*above, path))
        settings = merge(base, settings)
    try:
        kind.model.model_validate_json(json.dumps(settings, default=str), strict=True)
    except ValidationError as error:
        lines = explain_all(error, {}, str(path), section=(kind.section,))
        raise ScenarioError(all_in_one_line(list(dict.fromkeys(lines)))) from None
    return settings


def read_profile(name: str, *, folder: Path | None = None) -> DetectorSection:
    """Read a detector profile.

    Args:
        name: name of a shipped profile ("typical"), or of a TOML file, relative to ``folder``.
        folder: folder that is searched first; by default the working directory.

    Raises:
        ScenarioError: no profile has this name, or it has a key or value that a detector refuses.
    """
    folder = folder or Path()
    settings = read_preset(PROFILES, file_of(PROFILES, name, [folder], near=folder))
    return DetectorSection.model_validate_json(json.dumps(settings, default=str), strict=True)


def summary_of(path: Path) -> str:
    """Return one line about a preset: the first sentence of the comment at the top of its file."""
    words: list[str] = []
    for line in read_bytes(path, what="settings (TOML)", most=SETTINGS).decode(errors="replace").splitlines():
        if not line.removeprefix("#").strip() or not line.startswith("#"):
            break
        words += line.removeprefix("#").split()
    return re.split(r"\. (?=[A-Z])", " ".join(words), maxsplit=1)[0].removesuffix(".")


class Presets:
    """Presets that the settings of a scenario file or study name; each is read once."""

    def __init__(self, folders: Sequence[Path]) -> None:
        """Look for presets in ``folders``: those of the scenario and its bases."""
        self._folders = folders
        self._read: dict[tuple[str, str], dict[str, Any]] = {}

    def under(self, data: dict[str, Any], origins: Origins) -> dict[str, Any]:
        """Return the settings of a scenario, merged over the presets that they name.

        Args:
            data: settings of a scenario.
            origins: origins of the keys, for messages.

        Raises:
            ScenarioError: no such preset, or it has a key or value that the section refuses.
        """
        for kind in PRESET_KINDS:
            name = kind.name_in(data)
            section = data.get(kind.section, {})
            if not isinstance(section, Mapping):
                continue
            changes = {key: value for key, value in section.items() if key != kind.key}
            settings = self._settings(kind, name, origins)
            if changes and name and kind is PROFILES:
                settings = {**settings, "name": f"{settings.get('name', name)}, changed"}
            data = {**data, kind.section: merge(settings, changes)}
        return data

    def _settings(self, kind: PresetKind, name: Any, origins: Origins) -> dict[str, Any]:
        if name == "":
            return {}
        origin = origins.get((kind.section, kind.key))
        where = f"{origin}: " if origin else ""
        if not isinstance(name, str):
            raise ScenarioError(
                f"{where}{kind.section}.{kind.key}: expected the name of a {kind.title}, got {shown(name)}"
            )
        if (kind.section, name) not in self._read:
            try:
                path = file_of(kind, name, self._folders)
            except ScenarioError as error:
                raise ScenarioError(f"{where}{error}") from None
            self._read[kind.section, name] = read_preset(kind, path)
        return self._read[kind.section, name]
