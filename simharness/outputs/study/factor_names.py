"""Labels of swept keys on the axes of plots: plain names with units."""

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
        "cameras.spread": "angle from the first camera to the last",
        "clutter.coverage": "share of hidden joints",
        "detector.keypoints.quality": "factor of the profile's keypoint errors",
        "detector.phantoms.life": "mean lifetime of a phantom",
        "detector.phantoms.rate": "phantoms per view and frame",
        "detector.profile": "detector profile",
        "faults.center": "error of principal points",
        "faults.clock_jitter": "error of each picture's time",
        "faults.clock_offset": "error of each camera's clock",
        "faults.dropped": "probability that a picture is lost",
        "faults.focal": "error of focal lengths",
        "faults.rolling_shutter": "time from the first row to the last",
        "faults.rotation": "error of camera orientations",
        "faults.rotation_drift": "drift of camera orientations",
        "faults.translation": "error of camera positions",
        "faults.translation_drift": "drift of camera positions",
        "people.count": "people",
        "people.hidden": "time hidden from all cameras",
        "people.look_alike": "similarity of clothes, 1: one uniform",
        "people.passing": "distance between people who pass",
        "sensor.profile": "quality of the pictures",
    }
)
"""Names of the keys that the studies of this project sweep: the descriptions of keys are too long for an axis."""

_UNITS = (  # patterns in descriptions of keys, and the unit of each; the first match counts
    (r"degrees per minute", "degrees per minute"),
    (r"metres per minute", "m per minute"),
    (r"degrees", "degrees"),
    (r"metres", "m"),
    (r"seconds|^s(?=,)", "s"),
    (r"frames per second", "Hz"),
    (r"pixels|^px(?=,)", "px"),
    (r"newtons", "N"),
    (r"stops", "stops"),
    (r"relative", "relative"),
)


def axis_label(key: str) -> str:
    """Return the axis label of a key: its name in :data:`NAMES`, else the key itself, with the unit of its values."""
    unit = unit_of(key)
    return f"{NAMES.get(key, key)}, {unit}" if unit else NAMES.get(key, key)


def unit_of(key: str) -> str:
    """Return the unit in the scenario's description of a dotted key; empty where the description has none."""
    description = _description(key)
    return next((unit for pattern, unit in _UNITS if re.search(rf"\b(?:{pattern})\b", description)), "")


def _description(key: str) -> str:
    """Return the description of a scenario key; empty for keys that are not in a scenario, such as a profile's name."""
    section: object = Scenario
    description = None
    for part in key.split("."):
        if not (isinstance(section, type) and issubclass(section, BaseModel)) or part not in section.model_fields:
            return ""
        field = section.model_fields[part]
        section, description = field.annotation, field.description
    return description or ""
