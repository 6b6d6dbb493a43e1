"""Presets: files of settings of one section that scenarios begin with, by name.

``[detector] profile = "typical"`` takes ``scenarios/detectors/typical.toml`` and ``[cameras] rig = "dome12"`` takes
``scenarios/rigs/dome12.toml``: from ``detectors`` or ``rigs`` beside the scenario, or else what comes with the
project. Other keys of the section change it. A preset may begin with another one, too: ``profile = "typical"`` in its
first lines.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from simharness.scenario.layers import Places, over
from simharness.scenario.named_files import locate_files
from simharness.scenario.sections.cameras import Cameras
from simharness.scenario.sections.detector import Detector
from simharness.scenario.sections.section import Section
from simharness.scenario.toml_reader import ScenarioError, read_toml
from simharness.scenario.validation_messages import explain

SCENARIOS = Path(__file__).parents[2] / "scenarios"
"""Where the scenarios are that come with the project, and its presets beneath them."""


@dataclass(frozen=True)
class Kind:
    """A kind of preset.

    Attributes:
        section: that it is of.
        key: of the section that names one.
        title: what messages call one.
        folder: name of the folder that they lie in.
        model: of the section.
        default: the preset of those who name none; "": there is none.
    """

    section: str
    key: str
    title: str
    folder: str
    model: type[Section]
    default: str

    @property
    def shipped(self) -> Path:
        """The folder of those that come with the project."""
        return SCENARIOS / self.folder

    def named(self, data: Mapping[str, Any]) -> Any:
        """Which preset the settings of a scenario begin with; "": none, their section is written out.

        A detector that is written out says its name.
        """
        said = data.get(self.section, {})
        if not isinstance(said, Mapping):
            return ""
        return said.get(self.key, "" if "name" in said else self.default)


PROFILES = Kind("detector", "profile", "detector profile", "detectors", Detector, "typical")
RIGS = Kind("cameras", "rig", "rig", "rigs", Cameras, "")
KINDS = (PROFILES, RIGS)


def file_of(kind: Kind, name: str, folders: Sequence[Path], *, near: Path = Path()) -> Path:
    """The file of a preset.

    Args:
        kind: of preset.
        name: of it, or of a TOML file.
        folders: the preset is looked for in them, and beneath them in the folder of its kind, before the shipped.
        near: what the name of a file is relative to.

    Raises:
        ScenarioError: there is no preset of that name.
    """
    if name.endswith(".toml"):
        return near / name
    places = [folder if folder.name == kind.folder else folder / kind.folder for folder in folders] + [kind.shipped]
    for place in places:
        if (place / f"{name}.toml").is_file():
            return place / f"{name}.toml"
    known = sorted({file.stem for place in places for file in place.glob("*.toml")})
    close = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {close[0]}?" if close else ""
    raise ScenarioError(
        f"{kind.section}.{kind.key} = {_shown(name)}: no such {kind.key}; there are "
        f"{', '.join(known) or 'none'}, or name a file that ends in .toml.{hint}"
    )


def read_preset(kind: Kind, path: Path, *, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """The settings of a preset's file, with those that it begins with.

    Raises:
        ScenarioError: it cannot be read, begins with itself, or says something that its section has not.
    """
    if path in above:
        raise ScenarioError(
            f"{path}: begins with {kind.key} {above[-1].stem!r}, which begins with it; take one of them out"
        )
    settings = read_toml(path)
    begins = settings.pop(kind.key, "")
    locate_files({kind.section: settings}, path.parent)
    if not isinstance(begins, str):
        raise ScenarioError(f"{path}: {kind.key}: expected the name of a {kind.title}, got {_shown(begins)}")
    if begins:
        base = read_preset(kind, file_of(kind, begins, [path.parent], near=path.parent), above=(*above, path))
        settings = over(base, settings)
    try:
        kind.model.model_validate_json(json.dumps(settings, default=str), strict=True)
    except ValidationError as error:
        mistakes: list[Any] = [{**mistake, "loc": (kind.section, *mistake["loc"])} for mistake in error.errors()]
        lines = [explain(mistake, {}, str(path)) for mistake in mistakes]
        raise ScenarioError("\n".join(dict.fromkeys(lines))) from None
    return settings


def about(path: Path) -> str:
    """What a preset is, in a line: the first sentence of the comment that its file begins with."""
    words: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.removeprefix("#").strip() or not line.startswith("#"):
            break
        words += line.removeprefix("#").split()
    return re.split(r"\. (?=[A-Z])", " ".join(words), maxsplit=1)[0].removesuffix(".")


class Presets:
    """The presets that the settings of one scenario file, or of a study's, may name; each is read once."""

    def __init__(self, folders: Sequence[Path]) -> None:
        """Look for them in ``folders``: the scenario's and its bases'."""
        self._folders = folders
        self._read: dict[tuple[str, str], dict[str, Any]] = {}

    def under(self, data: dict[str, Any], places: Places) -> dict[str, Any]:
        """The settings with the presets under them that they name.

        Args:
            data: of a scenario.
            places: who set a key, for messages.

        Raises:
            ScenarioError: there is no such preset, or it says something that its section has not.
        """
        for kind in KINDS:
            name = kind.named(data)
            said = data.get(kind.section, {})
            if not isinstance(said, Mapping):
                continue
            said = {key: value for key, value in said.items() if key != kind.key}
            settings = self._settings(kind, name, places)
            if said and name and kind is PROFILES:
                settings = {**settings, "name": f"{settings.get('name', name)}, changed"}
            data = {**data, kind.section: over(settings, said)}
        return data

    def _settings(self, kind: Kind, name: Any, places: Places) -> dict[str, Any]:
        if name == "":
            return {}
        place = places.get((kind.section, kind.key))
        where = f"{place}: " if place else ""
        if not isinstance(name, str):
            raise ScenarioError(
                f"{where}{kind.section}.{kind.key}: expected the name of a {kind.title}, got {_shown(name)}"
            )
        if (kind.key, name) not in self._read:
            try:
                path = file_of(kind, name, self._folders)
            except ScenarioError as error:
                raise ScenarioError(f"{where}{error}") from None
            self._read[kind.key, name] = read_preset(kind, path)
        return self._read[kind.key, name]


def layered(base: dict[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """What is said over what was; a section that was written out makes way for a preset, not to change it."""
    for kind in KINDS:
        chosen = said.get(kind.section)
        if isinstance(chosen, Mapping) and chosen.get(kind.key) and not kind.named(base):
            base = {name: section for name, section in base.items() if name != kind.section}
    return over(base, said)


def _shown(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=str)
