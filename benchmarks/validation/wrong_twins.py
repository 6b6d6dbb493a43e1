"""Twins that are wrong in one way, of which a validation should notice each.

Each has the films, the people and the random draws of the right twins.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.twin import TwinModel
from simharness.reality.validation.treatments import Treatment
from simharness.scenario.sections.detector_section import KINDS, DetectorSection


@dataclass(frozen=True)
class WrongTwin:
    """A way in which twins are wrong; by default they are right."""

    model: Callable[[TwinModel], TwinModel] = lambda model: model
    """Change of what they are made from."""
    recording: Callable[[AnnotatedRecording, int], AnnotatedRecording] = lambda twin, seed: twin
    """Change of a finished twin, given its seed."""


def _detector(change: Callable[[DetectorSection], DetectorSection]) -> WrongTwin:
    return WrongTwin(lambda model: replace(model, detector=change(model.detector)))


def _with(detector: DetectorSection, section: str, **values: Any) -> DetectorSection:
    """Return a detector with other values of some keys of a section."""
    return detector.model_copy(update={section: getattr(detector, section).model_copy(update=values)})


def _times(detector: DetectorSection, factor: float, *keys: str) -> DetectorSection:
    """Return a detector with some errors of keypoints, by kind of joint, times a factor; shares are at most 1."""
    changed = {}
    for key in keys:
        values = getattr(detector.keypoints, key)
        most = np.inf if key == "scatter" else 1.0
        changed[key] = values.model_copy(update={kind: min(most, factor * getattr(values, kind)) for kind in KINDS})
    return _with(detector, "keypoints", **changed)


def scattered(factor: float) -> WrongTwin:
    """Return twins whose good keypoints scatter by another factor."""
    return _detector(lambda detector: _times(detector, factor, "scatter"))


def turned(degrees: float) -> WrongTwin:
    """Return twins of a wrong rig: each camera is turned about each axis, by random angles of this deviation."""
    return WrongTwin(recording=lambda twin, seed: Treatment("rotation", degrees)(twin))


def _without_memory(detector: DetectorSection) -> DetectorSection:
    return _with(_with(detector, "boxes", life=0.0), "correlation", life=0.0, scatter_life=0.0)


def _exact_annotation(model: TwinModel) -> TwinModel:
    return replace(model, annotation=replace(model.annotation, deviation=np.zeros_like(model.annotation.deviation)))


def _exchanged(twin: AnnotatedRecording, seed: int) -> AnnotatedRecording:
    """Return a twin in which the first camera and the last have each other's detections."""
    last = len(twin.rig) - 1
    exchanged = twin.subset([last, *range(1, last), 0])
    return replace(exchanged, rig=twin.rig)


WRONG: Mapping[str, WrongTwin] = {
    "scatter × 0.5": scattered(0.5),
    "scatter × 2": scattered(2.0),
    "no correlation in time": _detector(_without_memory),
    "nobody missed": _detector(lambda detector: _with(detector, "boxes", missed=0.0, missed_hidden=(0.0,) * 5)),
    "calibration turned by 0.25°": turned(0.25),
    "gross errors × 2": _detector(lambda detector: _times(detector, 2.0, "miss", "inversion", "swap")),
    "annotation without random errors": WrongTwin(_exact_annotation),
    "two cameras exchanged": WrongTwin(recording=_exchanged),
}
"""Wrong twins by name."""

SIZES: Mapping[str, WrongTwin] = {
    **{f"scatter × {factor:g}": scattered(factor) for factor in (0.7, 0.8, 0.9, 1.1, 1.25, 1.4)},
    **{f"calibration turned by {degrees:g}°": turned(degrees) for degrees in (0.05, 0.1, 0.15)},
}
"""Smaller errors of two kinds, which say from which size on they are noticed."""
