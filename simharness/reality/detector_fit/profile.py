"""Detector profile from a measurement: a file of [detector] parameters with intervals and notes on their source."""

import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.input_files import parse_toml
from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.detector_fit.detector_measurement import MeasuredDetector
from simharness.reality.detector_fit.parameters import UNCOVERED
from simharness.scenario.presets import read_profile
from simharness.scenario.sections.detector_section import KINDS, LARGEST_MULTIPLE, DetectorSection

_FACE_DROPS = ("keypoints.drop.visible", "keypoints.drop.self_occluded")

PRIORS: Mapping[DetectorKind, str] = {"top-down": "topdown", "bottom-up": "typical"}
"""Shipped profile of each kind of detector."""

_OF_QUALITY = ("keypoints.jitter.", "keypoints.miss.", "keypoints.inversion.", "keypoints.swap.")

_ESTIMATES = {
    "keypoints.inversion_reach": 0.3,
    **dict.fromkeys(("keypoints.inversion_uncovered", "keypoints.swap_uncovered"), UNCOVERED),
    "keypoints.drop.depth": 10.0,
    **dict.fromkeys(("keypoints.drop.edge.self_occluded", "keypoints.drop.edge.occluded"), 0.5),
    **{f"keypoints.stray.{kind}": 0.3 for kind in KINDS[3:]},
}
"""Estimates of parameters that the shipped profiles leave out."""

_MOST = {
    "keypoints.jitter": 1.0,
    "keypoints.miss": 1.0,
    "keypoints.self_occluded": LARGEST_MULTIPLE,
    "keypoints.occluded": LARGEST_MULTIPLE,
    "keypoints.scatter": 100.0,
    "keypoints.guess.scatter": 100.0,
    "keypoints.truncated": 100.0,
    "keypoints.small": 10.0,
    "keypoints.inversion_reach": 3.0,
    "keypoints.drop.depth": 100.0,
    "boxes.jitter": 0.5,
    "phantoms.rate": 20.0,
}
"""Largest value that a profile may hold, by the beginning of the keys."""


def settings(measurement: MeasuredDetector, *, name: str, bias: Floats | None = None) -> dict[str, Any]:
    """Return the [detector] section as nested plain values that pass ``Detector.model_validate``.

    Parameters that could not be measured keep their default, which is no error.

    Args:
        measurement: measured parameters.
        name: name of the profile.
        bias: offset of the joints by kind, (9, 3) metres; None: no bias.
    """
    result: dict[str, Any] = {"name": name, "kind": measurement.kind, "measured": True}
    lists: dict[str, list[float]] = {}
    for key, measured in measurement.values.items():
        section, kind = key.partition(".")[0], key.rpartition(".")[2]
        if section in {"share", "size"} or not measured.known:
            continue
        if kind.isdigit():
            lists.setdefault(key.rpartition(".")[0], []).append(_rounded(key, measured.value))
        elif not (key.startswith(_FACE_DROPS) and kind in KINDS[:3]):
            _put(result, key, _rounded(key, measured.value))
    for key, values in lists.items():
        _put(result, key, values)
    if bias is not None:
        rows = np.round(bias, 4) + 0.0  # no minus zero
        result["bias"] = {kind: row.tolist() for kind, row in zip(KINDS, rows, strict=True)}
    return DetectorSection.model_validate(result).model_dump(mode="json", exclude_unset=True)


def prior_of(kind: DetectorKind) -> dict[str, float]:
    """Return the parameters of the shipped profile of a kind of detector by dotted key, before any measurement."""
    profile = read_profile(PRIORS[kind])
    quality, result = profile.keypoints.quality, dict(_ESTIMATES)
    for key, value in _numbers(profile.model_dump(), ""):
        if key not in _ESTIMATES or value not in (0.0, 1.0):  # no effect
            result[key] = quality * value if key.startswith(_OF_QUALITY) else value
    return result


def _numbers(tree: Mapping[str, Any], path: str) -> Iterator[tuple[str, float]]:
    """Yield the dotted keys and the values of the numbers in nested tables."""
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{path}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{path}{key}", float(value)


def as_toml(
    measurement: MeasuredDetector,
    *,
    name: str,
    bias: Floats | None = None,
    command: str = "",
    notes: str = "recording",
    of: str = "annotated people",
) -> str:
    """Return the profile as a file: every value with its interval and count, and notes on what was not measured.

    Args:
        measurement: the measured, or calibrated, parameters.
        name: name of the profile.
        bias: as of :func:`settings`.
        command: command that made it.
        notes: name of the notes, in ``data/notes.toml``.
        of: who the people are.
    """
    tree = settings(measurement, name=name, bias=bias)
    joints = sum(measured.count for key, measured in measurement.values.items() if key.startswith("share.drop."))
    head = (
        f"Errors of a detector on {measurement.name}: measured on {measurement.frames} frames, {joints} joints of "
        f"{measurement.people:.2f} {of} a frame. Behind each value: its 95 % interval (bootstrap of blocks of time or "
        f"of scenes) and the number n of joints, people or detections."
    )
    all_notes = parse_toml((Path(__file__).parent / "data" / "notes.toml").read_text(encoding="utf-8"))
    lines = [*_wrapped(head)]
    if command:
        lines.append(f"# Made by: {command}")
    lines += [f'name = "{tree["name"]}"', f'kind = "{tree["kind"]}"', "measured = true"]
    for section in ("keypoints", "bias", "correlation", "scores", "boxes", "phantoms", "decoys"):
        if section in tree or section != "decoys":
            lines += _section(section, tree.get(section, {}), measurement, all_notes[notes])
    return "\n".join(lines) + "\n"


def _section(
    path: str, values: Mapping[str, Any], measurement: MeasuredDetector, notes: Mapping[str, str]
) -> Iterator[str]:
    """Yield the lines of a section and of the sections in it."""
    yield ""
    if path in notes:
        yield from _wrapped(notes[path])
    yield f"[{path}]"
    for key, value in values.items():
        if not isinstance(value, dict):
            comment = "" if isinstance(value, list) else _comment(f"{path}.{key}", measurement)
            yield (f"{key} = {value}".ljust(40) + comment).rstrip()
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _section(f"{path}.{key}", value, measurement, notes)


def _comment(key: str, measurement: MeasuredDetector) -> str:
    """Return the comment behind a value: its interval and count, or that it was not measured."""
    measured = measurement.values.get(key)
    if measured is None or not measured.known:
        return "# not measured"
    span = f"{measured.low:.3g} to {measured.high:.3g}; " if np.isfinite(measured.low) else ""
    return f"# {span}n = {measured.count}{'; mostly the prior' if measured.by_prior else ''}"


def _put(tree: dict[str, Any], key: str, value: Any) -> None:
    """Set the value of a dotted key in nested tables."""
    *path, last = key.split(".")
    for name in path:
        tree = tree.setdefault(name, {})
    tree[last] = value


def _rounded(key: str, value: float) -> float:
    """Round to four decimal places, finer than any interval; shares that factors multiply, to three digits.

    Correlations below 0, and values that the inference raised too far are bounded.
    """
    bound = next((most for start, most in _MOST.items() if key.startswith(start)), float("inf"))
    value = float(min(max(value, 0.0), bound))
    return float(f"{value:.3g}") if key.startswith(("keypoints.miss.", "keypoints.jitter.")) else round(value, 4)


def _wrapped(text: str) -> list[str]:
    """Return a text as comment lines."""
    return [f"# {line}" for line in textwrap.wrap(text, 118)]
