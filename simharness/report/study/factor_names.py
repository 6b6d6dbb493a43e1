"""What a swept key is called on the axis of a plot: in plain words and with its unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

from pydantic import BaseModel

from simharness.scenario.sections.scenario import Scenario

NAMES: Mapping[str, str] = MappingProxyType(
    {
        "cameras.count": "cameras",
        "cameras.preset": "rig",
        "cameras.spread": "from the first camera to the last",
        "clutter.coverage": "share of joints that are hidden",
        "detector.keypoints.quality": "multiple of the profile's keypoint errors",
        "detector.phantoms.life": "mean life of a phantom",
        "detector.phantoms.rate": "phantoms in a view and frame",
        "detector.profile": "detector profile",
        "faults.center": "error of principal points",
        "faults.clock_jitter": "error of each picture's time",
        "faults.clock_offset": "error of each camera's clock",
        "faults.dropped": "chance that a picture is lost",
        "faults.focal": "error of focal lengths",
        "faults.rolling_shutter": "time from the first row to the last",
        "faults.rotation": "error of camera orientations",
        "faults.rotation_drift": "how fast cameras turn",
        "faults.translation": "error of camera positions",
        "faults.translation_drift": "how fast cameras move",
        "people.count": "people",
        "people.look_alike": "likeness of clothes, 1: one uniform",
    }
)
"""Of the keys that the studies of this project sweep; descriptions of keys are for files and too long for an axis."""

_UNITS = (  # as descriptions of keys write them; the first that is there counts
    (r"degrees a minute", "degrees a minute"),
    (r"metres a minute", "m a minute"),
    (r"degrees", "degrees"),
    (r"metres", "m"),
    (r"seconds|^s(?=,)", "s"),
    (r"frames per second", "Hz"),
    (r"pixels|^px(?=,)", "px"),
    (r"newtons", "N"),
    (r"stops", "stops"),
    (r"as a share", "as a share"),
)


def axis_label(key: str) -> str:
    """A key as an axis names it: its name, or else the key, with the unit of its values."""
    unit = unit_of(key)
    return f"{NAMES.get(key, key)}, {unit}" if unit else NAMES.get(key, key)


def unit_of(key: str) -> str:
    """The unit that the scenario's description of a dotted key tells; empty where it tells none."""
    told = _description(key)
    return next((unit for pattern, unit in _UNITS if re.search(rf"\b(?:{pattern})\b", told)), "")


def _description(key: str) -> str:
    """Of a key of a scenario; empty of a key that is none, such as a profile's name."""
    section: object = Scenario
    told = None
    for part in key.split("."):
        if not (isinstance(section, type) and issubclass(section, BaseModel)) or part not in section.model_fields:
            return ""
        field = section.model_fields[part]
        section, told = field.annotation, field.description
    return told or ""
