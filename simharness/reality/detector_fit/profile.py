"""Detector profile from a measurement: a file of [detector] parameters with intervals and notes on their source."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from simharness.reality.detector_fit.measure import MeasuredValue, Measurement
from simharness.reality.detector_fit.parameters import LIMB_KINDS
from simharness.scenario.sections.detector import KINDS, Detector

NAME = "openpose-shelf"

STAND_IN = KINDS[3]
"""Kind of joint whose errors replace those of the face, which has no truth; in units of each joint's sigma."""

_MEASURED = tuple(KINDS[kind] for kind in LIMB_KINDS)
_BIAS = ("forward", "outward", "up")

_NOTES: Mapping[str, str] = {
    "keypoints": (
        "Shares of the visible joints that the classes before left. Visibility is estimated with capsules about the "
        "skeletons and corrected for the errors of that estimate on simulated people; joints hidden by furniture count "
        "as visible. The error of the truth is part of scatter. miss_some, miss_few and swap_crowded: not measured, as "
        "the rates without them. small: not measurable, all people are taller than 64 px. truncated: not measured, few "
        "people are cut by the border. hallucinate: not measured. reach: by definition; misses well beyond it are in "
        "stray."
    ),
    "keypoints.drop": "Shares of the joints in the picture that are not reported; measured for the face, too.",
    "bias": "Metres forward, outward and up in the body's frame, by robust least squares over the views.",
    "correlation": (
        "Tetrachoric correlations of all classes together over views and within limbs; lives from autocorrelations up "
        "to one second; scatter_views from products of the residuals of two views along directions that they share."
    ),
    "scores": "Medians, of visible joints where visibility matters; deviation on the logit scale; face as reported.",
    "boxes": (
        "missed: share of people with at least half of their limb joints in the picture. The detector reports neither "
        "boxes nor box scores: jitter, merged, split, score and deviation are not measured."
    ),
    "phantoms": (
        "Detections that show no annotated person and agree with no other view: an upper bound of false positives. "
        "views: 0 by this definition. parts and plausible: not measured."
    ),
}


def settings(measurement: Measurement, *, name: str = NAME) -> dict[str, Any]:
    """Return the [detector] section as nested plain values that pass ``Detector.model_validate``.

    Parameters that could not be measured keep their default, which is no error; the face has those of STAND_IN.
    """
    result: dict[str, Any] = {"name": name}
    for key, measured in measurement.values.items():
        section = key.partition(".")[0]
        if section in {"share", "size", "bias"} or not measured.known:
            continue
        _put(result, key, _rounded(key, measured.value))
    for key in ("keypoints.scatter", "keypoints.swap", "keypoints.inversion", "keypoints.miss", "keypoints.jitter"):
        for kind in KINDS:
            stand_in = measurement[f"{key}.{kind if kind in _MEASURED else STAND_IN}"]
            _put(result, f"{key}.{kind}", _rounded(key, stand_in.value) if stand_in.known else 0.0)
    for kind in KINDS:
        offset = [measurement[f"bias.{direction}.{kind}"] for direction in _BIAS]
        _put(result, f"bias.{kind}", [round(each.value, 4) if each.known else 0.0 for each in offset])
    return Detector.model_validate(result).model_dump(mode="json", exclude_unset=True)


def as_toml(measurement: Measurement, *, name: str = NAME, command: str = "") -> str:
    """Return the profile as a file: every value with its interval and count, and notes on what was not measured."""
    tree = settings(measurement, name=name)
    joints = sum(measured.count for key, measured in measurement.values.items() if key.startswith("share.drop."))
    head = (
        f"Errors of a detector on {measurement.name}: measured on {measurement.frames} frames, {joints} joints of "
        f"{measurement.people:.2f} annotated people a frame. Behind each value: its 95 % interval (block bootstrap "
        f"over time) and the number n of joints, people or detections. The face has no truth: its errors are "
        f"those of {STAND_IN}, in units of its own sigmas; its drops and scores are measured."
    )
    lines = [*_wrapped(head)]
    if command:
        lines.append(f"# Made by: {command}")
    lines += [f'name = "{tree["name"]}"']
    for section in ("keypoints", "bias", "correlation", "scores", "boxes", "phantoms"):
        lines += _section(section, tree.get(section, {}), measurement)
    return "\n".join(lines) + "\n"


def _section(path: str, values: Mapping[str, Any], measurement: Measurement) -> Iterator[str]:
    """Yield the lines of a section and of the sections in it."""
    yield ""
    if path in _NOTES:
        yield from _wrapped(_NOTES[path])
    yield f"[{path}]"
    for key, value in values.items():
        if not isinstance(value, dict):
            yield f"{key} = {value}".ljust(40) + _comment(f"{path}.{key}", measurement)
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _section(f"{path}.{key}", value, measurement)


def _comment(key: str, measurement: Measurement) -> str:
    """Return the comment behind a value: its interval and count, or that it was not measured."""
    section, kind = key.partition(".")[0], key.rpartition(".")[2]
    if section == "bias":
        if kind not in _MEASURED:
            return "# not measured"
        directions = [measurement[f"bias.{direction}.{kind}"] for direction in _BIAS]
        spans = ", ".join(f"{each.low:.3f} to {each.high:.3f}" for each in directions)
        return f"# {spans}; n = {directions[0].count}"
    measured = measurement.values.get(key)
    if measured is None or not measured.known:
        return f"# not measured: as {STAND_IN}" if kind in KINDS else "# not measured"
    return f"# {_span(measured)}; n = {measured.count}"


def _span(measured: MeasuredValue) -> str:
    """Return the interval of a value as text."""
    return f"{measured.low:.3g} to {measured.high:.3g}"


def _put(tree: dict[str, Any], key: str, value: Any) -> None:
    """Set the value of a dotted key in nested tables."""
    *path, last = key.split(".")
    for name in path:
        tree = tree.setdefault(name, {})
    tree[last] = value


def _rounded(key: str, value: float) -> float:
    """Round to four decimal places, finer than any interval; shares that a factor raised above 1 become 1."""
    most = 1.0 if key.startswith(("keypoints.jitter", "keypoints.miss")) else float("inf")
    return round(min(value, most), 4)


def _wrapped(text: str) -> list[str]:
    """Return a text as comment lines."""
    return [f"# {line}" for line in textwrap.wrap(text, 118)]
