"""The measured figures as a profile: a file of [detector] settings, with a word on where each section comes from."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from simharness.reality.detector_fit.measure import Figure, Measurement
from simharness.reality.detector_fit.parameters import LIMB_KINDS
from simharness.scenario.sections.detector import KINDS, Detector

NAME = "openpose-shelf"

STAND_IN = KINDS[3]
"""Whose errors stand in for those of the face, which has no truth: the shoulders', in units of each joint's sigma."""

_MEASURED = tuple(KINDS[kind] for kind in LIMB_KINDS)
_BIAS = ("forward", "outward", "up")

_NOTES: Mapping[str, str] = {
    "keypoints": (
        "Shares of the visible joints that no class before took. Whose joints were visible is told by capsules about "
        "the skeletons, corrected for what they get wrong on simulated people; what furniture hides counts as visible. "
        "The truth's own error is in the scatter. miss_some, miss_few and swap_crowded: not measured, as the others. "
        "small: not measurable, everybody is taller than 64 px. truncated: not measured, hardly anybody is cut. "
        "hallucinate: not measured. reach: by definition; what lies well beyond is in stray."
    ),
    "keypoints.drop": "Shares of the joints in the picture that are not reported; the face is measured, too.",
    "bias": "Metres forward, outward and up in the body's frame, by robust least squares over the views.",
    "correlation": (
        "Tetrachoric correlations of all classes together over views and within limbs; lives from autocorrelations up "
        "to a second; scatter_views from products of the residuals of two views along directions that they share."
    ),
    "scores": "Medians, of visible joints where it matters; deviations on the logit scale; the face as reported.",
    "boxes": (
        "Missed: of people with at least half of their limb joints in the picture. The detector has neither boxes nor "
        "their scores of its own: jitter, merged, split, score and deviation are not measured."
    ),
    "phantoms": (
        "Detections that show no annotated person and agree with no other view: at most so many are false. views: none "
        "by this definition. parts and plausible: not measured."
    ),
}


def settings(measurement: Measurement, *, name: str = NAME) -> dict[str, Any]:
    """The [detector] section, as nested plain values; it passes ``Detector.model_validate``.

    What could not be measured keeps its default, which is none of it; only the face gets what its stand-in has.
    """
    result: dict[str, Any] = {"name": name}
    for key, figure in measurement.figures.items():
        section = key.partition(".")[0]
        if section in {"share", "size", "bias"} or not figure.known:
            continue
        _put(result, key, _rounded(key, figure.value))
    for key in ("keypoints.scatter", "keypoints.swap", "keypoints.inversion", "keypoints.miss", "keypoints.jitter"):
        for kind in KINDS:
            stand_in = measurement[f"{key}.{kind if kind in _MEASURED else STAND_IN}"]
            _put(result, f"{key}.{kind}", _rounded(key, stand_in.value) if stand_in.known else 0.0)
    for kind in KINDS:
        offset = [measurement[f"bias.{way}.{kind}"] for way in _BIAS]
        _put(result, f"bias.{kind}", [round(each.value, 4) if each.known else 0.0 for each in offset])
    return Detector.model_validate(result).model_dump(mode="json", exclude_unset=True)


def as_toml(measurement: Measurement, *, name: str = NAME, command: str = "") -> str:
    """The profile as a file: every figure with its interval and of how many, and notes on what was not measured."""
    tree = settings(measurement, name=name)
    measured = sum(figure.count for key, figure in measurement.figures.items() if key.startswith("share.drop."))
    head = (
        f"A detector as it errs on {measurement.name}: measured on {measurement.frames} frames, {measured} joints of "
        f"{measurement.people:.2f} annotated people a frame. Behind each figure its 95 % interval (block bootstrap "
        f"over time) and of how many joints, people or detections it is. The face has no truth there: its errors are "
        f"the {STAND_IN}', in units of its own sigmas; its share of drops and its scores are measured."
    )
    lines = [*_wrapped(head)]
    if command:
        lines.append(f"# Made by: {command}")
    lines += [f'name = "{tree["name"]}"']
    for section in ("keypoints", "bias", "correlation", "scores", "boxes", "phantoms"):
        lines += _section(section, tree.get(section, {}), measurement)
    return "\n".join(lines) + "\n"


def _section(path: str, values: Mapping[str, Any], measurement: Measurement) -> Iterator[str]:
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
    section, kind = key.partition(".")[0], key.rpartition(".")[2]
    if section == "bias":
        if kind not in _MEASURED:
            return "# not measured"
        ways = [measurement[f"bias.{way}.{kind}"] for way in _BIAS]
        spans = ", ".join(f"{each.low:.3f} to {each.high:.3f}" for each in ways)
        return f"# {spans}; n = {ways[0].count}"
    figure = measurement.figures.get(key)
    if figure is None or not figure.known:
        return f"# not measured: the {STAND_IN}'" if kind in KINDS else "# not measured"
    return f"# {_span(figure)}; n = {figure.count}"


def _span(figure: Figure) -> str:
    return f"{figure.low:.3g} to {figure.high:.3g}"


def _put(tree: dict[str, Any], key: str, value: Any) -> None:
    *path, last = key.split(".")
    for name in path:
        tree = tree.setdefault(name, {})
    tree[last] = value


def _rounded(key: str, value: float) -> float:
    """Four digits behind the point: finer than any interval. Shares above 1 can come of dividing by a factor."""
    most = 1.0 if key.startswith(("keypoints.jitter", "keypoints.miss")) else float("inf")
    return round(min(value, most), 4)


def _wrapped(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, 118)]
