"""Layers of settings: a file over its base, a scenario over its presets, a sweep over a scenario.

Kinds of presets are rigs, sensor profiles and detector profiles: ``[detector] profile = "typical"`` takes
``scenarios/detectors/typical.toml``, ``[sensor] profile = "webcam"`` takes ``scenarios/sensors/webcam.toml`` and
``[cameras] rig = "dome12"`` takes ``scenarios/rigs/dome12.toml``.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from simharness.scenario.sections.cameras_section import CamerasSection, SensorSection
from simharness.scenario.sections.detector_section import KINDS, DetectorSection
from simharness.scenario.sections.section import Section
from simharness.scenario.shipped import shipped_folder

Key = tuple[str, ...]
Origins = dict[Key, str]
"""Origin of each key that was set last by something other than the file being read, for messages: ``--set
people.count=6`` for ("people", "count"). Entries are in the order in which keys were set."""

RANGE = ("from", "to", "steps", "scale")
"""Keys of a range of values in a sweep."""


@dataclass(frozen=True)
class PresetKind:
    """Kind of preset."""

    section: str
    """Section to which the presets belong."""
    key: str
    """Key of the section that names a preset."""
    title: str
    """Name of the kind in messages."""
    folder: str
    """Name of the folder of the presets."""
    model: type[Section]
    """Model of the section."""
    default: str
    """Preset of scenarios that name none; "": no preset."""

    @property
    def shipped(self) -> Path:
        """Folder of the shipped presets."""
        return shipped_folder() / self.folder

    def name_in(self, data: Mapping[str, Any]) -> Any:
        """Return the preset with which the settings of a scenario begin; "": none, the section is written out.

        A detector that is written out has a key ``name``.
        """
        section = data.get(self.section, {})
        if not isinstance(section, Mapping):
            return ""
        return section.get(self.key, "" if "name" in section else self.default)


PROFILES = PresetKind("detector", "profile", "detector profile", "detectors", DetectorSection, "typical")
RIGS = PresetKind("cameras", "rig", "rig", "rigs", CamerasSection, "")
SENSORS = PresetKind("sensor", "profile", "sensor profile", "sensors", SensorSection, "machine-vision")
PRESET_KINDS = (PROFILES, RIGS, SENSORS)


def merge(base: Any, changes: Any) -> Any:
    """Return changes over a base; both stay as they are.

    Sections are merged key by key. Lists and ranges are replaced. A number for all kinds of joints is expanded where
    the changes name single kinds.
    """
    if not isinstance(changes, Mapping) or is_range(changes):
        return changes
    if isinstance(base, int | float) and changes and set(changes) <= set(KINDS):
        base = dict.fromkeys(KINDS, base)
    if not isinstance(base, Mapping):
        return changes
    return {**base, **{key: merge(base.get(key), value) for key, value in changes.items()}}


def merge_with_presets(base: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes over a base, where a preset that the changes name replaces a section that is written out."""
    for kind in PRESET_KINDS:
        chosen = changes.get(kind.section)
        if isinstance(chosen, Mapping) and chosen.get(kind.key) and not kind.name_in(base):
            base = {name: section for name, section in base.items() if name != kind.section}
    return merge(base, changes)


def is_range(table: Mapping[str, Any]) -> bool:
    """Return whether a table is a range of values, not a section."""
    return any(key in table for key in RANGE)


def nested(key: Key, value: Any) -> dict[str, Any]:
    """Return ``{"people": {"count": 6}}`` for ``("people", "count"), 6``."""
    for part in reversed(key):
        value = {part: value}
    return value


def leaves(data: Mapping[str, Any], above: Key = ()) -> Iterator[tuple[Key, Any]]:
    """Yield the keys of all sections, each with its value; a section is a value where it is empty."""
    for name, value in data.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, (*above, name))
        else:
            yield (*above, name), value


def set_origin(origins: Origins, key: Key, origin: str) -> None:
    """Record what set a key last."""
    origins.pop(key, None)  # the order of the entries is the order of setting
    origins[key] = origin


def overlap(one: Key, other: Key) -> bool:
    """Return whether two keys are the same, or one is a section that holds the other."""
    shared = min(len(one), len(other))
    return one[:shared] == other[:shared]
