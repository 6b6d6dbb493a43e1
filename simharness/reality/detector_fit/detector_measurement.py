"""Measurement of a detector on a sample: every parameter with its 95 % interval."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.detector_fit.detector_sums import FrameSums
from simharness.reality.detector_fit.frame_sums import SCORED, frame_sums
from simharness.reality.detector_fit.joint_labels import CLASSES, LabelledJoints, label_joints
from simharness.reality.detector_fit.parameters import STATES, estimate_parameters
from simharness.reality.detector_fit.sample import Sample
from simharness.scenario.sections.detector_section import KINDS
from simharness.statistics.resampling import block_weights, blocks, interval

RESAMPLES = 500

_RULE_OF_THREE = 3.0
"""An event that never happened in n independent trials has a probability of at most 3 / n, at 95 %. Correlated trials
count as fewer."""

_COUNTED_ERRORS = (*CLASSES, "guess", "wrong", "missed", "duplicates")

_COUNTED: Mapping[str, Callable[[FrameSums], Floats]] = {
    "keypoints.inversion_uncovered": lambda sums: sums.classes["inversion"].k[:, 2],
    "keypoints.swap_uncovered": lambda sums: sums.classes["swap"].k[:, 2],
    "keypoints.inversion_reach": lambda sums: sums.apart.k,
    "keypoints.drop.depth": lambda sums: sums.depth.n.sum(axis=-1),
    "keypoints.drop.edge.self_occluded": lambda sums: sums.edge.n[:, 0],
    "keypoints.drop.edge.occluded": lambda sums: sums.edge.n[:, 1],
    "keypoints.stray": lambda sums: sums.miss.n,
    "boxes": lambda sums: sums.people.all.n,
    "boxes.duplicates": lambda sums: sums.people.detected,
    "phantoms": lambda sums: sums.false.n,
    "size": lambda sums: sums.size.n,
    "size.fragments": lambda sums: sums.false.fragments,
}
"""Sums that count the observations behind a parameter; the others are measured on all joints in the picture."""

_COUNTED_BY_KIND: Mapping[str, Callable[[FrameSums], Floats]] = {
    "self_occluded": lambda sums: sums.classes["miss"].n[:, STATES.index("self_occluded")],
    "occluded": lambda sums: sums.classes["miss"].n[:, STATES.index("occluded")],
    "scatter_hidden": lambda sums: sums.scatter.hidden_n,
    "jitter_mean": lambda sums: sums.jitter.n,
    "gross": lambda sums: (sums.classes["miss"].k + sums.classes["jitter"].k).sum(axis=1),
}
"""Sums, (T, 9), that count the joints of each kind behind a parameter."""


@dataclass(frozen=True)
class MeasuredValue:
    """One measured parameter; NaN where it is unknown.

    Attributes:
        value: estimate from all frames.
        low, high: bounds of its 95 % interval.
        count: number of joints, people or pictures behind it.
        by_prior: whether it is an inferred parameter about which the recording says little.
    """

    value: float
    low: float
    high: float
    count: int
    by_prior: bool = False

    @property
    def known(self) -> bool:
        """Whether it could be measured."""
        return bool(np.isfinite(self.value))

    def agrees(self, other: "MeasuredValue") -> bool:
        """Return whether two measured values differ by no more than the interval of their difference.

        That interval is the root of the squared half-widths, each on the side that faces the other value, because the
        two measurements are independent.
        """
        first, second = (self, other) if self.value <= other.value else (other, self)
        room = np.hypot(first.high - first.value, second.value - second.low)
        return bool(second.value - first.value <= room + 1e-12)


@dataclass(frozen=True)
class MeasuredDetector:
    """Measured parameters of a detector."""

    name: str
    """Name of the sample."""
    frames: int
    """Number of frames."""
    people: float
    """Mean number of measured people in a frame."""
    kind: DetectorKind
    """Kind of the detector."""
    values: Mapping[str, MeasuredValue]
    """Measured values by key of ``[detector]``; also ``share.`` and ``size.``."""

    def with_values(self, values: Mapping[str, float]) -> "MeasuredDetector":
        """Return the measurement with other values, in the same intervals."""
        return replace(self, values={key: replace(each, value=values[key]) for key, each in self.values.items()})

    def __getitem__(self, key: str) -> MeasuredValue:
        """Return the measured value of a key."""
        return self.values[key]

    def summary(self) -> dict[str, Any]:
        """Return the measurement ready for JSON; unknown values are null."""
        return {
            "name": self.name,
            "frames": self.frames,
            "people": self.people,
            "level": 0.95,
            "figures": {
                key: {
                    name: value if np.isfinite(value := float(getattr(each, name))) else None
                    for name in ("value", "low", "high")
                }
                | {"n": each.count}
                for key, each in self.values.items()
            },
        }


def measure_detector(
    sample: Sample, *, labels: LabelledJoints | None = None, resamples: int = RESAMPLES, seed: int = 0
) -> MeasuredDetector:
    """Measure a detector.

    Intervals come from a block bootstrap over time (:mod:`simharness.statistics.resampling`). They cover other
    recordings of the same people at the same work, at the measured bias; not recordings of other people.

    Args:
        sample: people with known joints, and the detections.
        labels: its labelled joints, where they are known already.
        resamples: number of resamples of the bootstrap.
        seed: seed of the resamples.

    Raises:
        ValueError: a sample without a known person, or in which no detection shows one.
    """
    if not sample.known.any():
        raise ValueError(f"{sample.name}: expected people with known joints, got none in {len(sample)} frames")
    labels = label_joints(sample) if labels is None else labels
    if not labels.association.detected.any():
        raise ValueError(
            f"{sample.name}: no detection is near any of the known people; expected detections of the same frames and "
            "cameras as the truth. Check that calibration, truth and detections belong together"
        )
    weights = block_weights(sample.time, resamples=resamples, seed=seed)
    return measure_labels(labels, name=sample.name, weights=weights, independent=blocks(sample.time))


def measure_labels(labels: LabelledJoints, *, name: str, weights: Floats, independent: int) -> MeasuredDetector:
    """Measure a detector from labelled joints.

    Args:
        labels: labels of T frames.
        name: name of the sample.
        weights: how many times each of R resamples contains each frame, (R, T).
        independent: number of independent parts of the sample.
    """
    sums = frame_sums(labels)
    whole = estimate_parameters(sums.total(), step=labels.step, kind=labels.kind)
    drawn = estimate_parameters(sums.resampled(weights), step=labels.step, kind=labels.kind)
    result = {}
    design = 1 + 2 * np.nan_to_num(whole["correlation.life"][0]) / labels.step
    for key, value in whole.items():
        low, high = interval(drawn[key], blocks=independent)
        n = _count(key, sums)
        if key.split(".")[1] in _COUNTED_ERRORS and value[0] < _RULE_OF_THREE * design / max(n, 1):
            high = np.fmax(high, min(1.0, _RULE_OF_THREE * design / max(n, 1)))
        # A percentile interval need not contain the value itself near a bound such as zero.
        result[key] = MeasuredValue(float(value[0]), float(np.fmin(low, value[0])), float(np.fmax(high, value[0])), n)
    frames = len(labels.time)
    return MeasuredDetector(name, frames, float(labels.known.sum() / frames), labels.kind, result)


def point_estimates(sample: Sample) -> dict[str, float]:
    """Return the measured values of a sample without their intervals, by key; NaN where unknown."""
    return label_estimates(label_joints(sample))


def label_estimates(labels: LabelledJoints) -> dict[str, float]:
    """Return the measured values of labelled joints without their intervals, by key; NaN where unknown."""
    values = estimate_parameters(frame_sums(labels).total(), step=labels.step, kind=labels.kind)
    return {key: float(value[0]) for key, value in values.items()}


FITTED_SECTIONS = ("keypoints", "correlation", "scores", "boxes", "phantoms")
"""Sections of measured values that describe the detector. The others (share, size) also depend on the scene."""


def agreement(real: MeasuredDetector, simulated: MeasuredDetector) -> tuple[list[str], int]:
    """Return the parameters that differ by more than their intervals allow, and the number of parameters compared.

    About 5 % of equal parameters differ by more.
    """
    known = [key for key, each in real.values.items() if each.known and simulated[key].known]
    compared = [key for key in known if key.split(".")[0] in FITTED_SECTIONS]
    return [key for key in compared if not real[key].agrees(simulated[key])], len(compared)


def _count(key: str, sums: FrameSums) -> int:
    """Return the number of joints, people or pictures behind a parameter."""
    section, *rest = key.split(".")
    kind = KINDS.index(rest[-1]) if rest[-1] in KINDS else None
    if rest[0] in CLASSES and kind is not None:
        n = sums.classes[rest[0]].n[..., kind].sum(axis=0)
        return int(n[STATES.index(rest[1])] if rest[1] in STATES else n.sum())
    if rest[0] in ("guess", "wrong") and rest[1] in STATES:
        return int(sums.classes["miss"].n[:, STATES.index(rest[1]), kind].sum())
    if rest[0] in _COUNTED_BY_KIND and kind is not None:
        return int(_COUNTED_BY_KIND[rest[0]](sums)[:, kind].sum())
    if section == "scores":
        scores = sums.scores.shown if kind is None else sums.scores.shown[..., kind, :]
        return int((scores[:, :, SCORED.index(rest[0])] if rest[0] in SCORED else scores).sum())
    if kind is not None:
        return int(sums.scatter.n[:, kind].sum())
    counted = _COUNTED.get(key, _COUNTED.get(section, lambda sums: sums.classes["drop"].n))
    return int((sums.people.hidden.n[:, int(rest[-1])] if rest[0] == "missed_hidden" else counted(sums)).sum())
