"""A detector measured on a sample: every figure with the interval that it lies in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from simharness.reality.detector_fit.frame_sums import SCORED, Sums, count
from simharness.reality.detector_fit.joint_labels import CLASSES, judge
from simharness.reality.detector_fit.parameters import figures
from simharness.reality.detector_fit.sample import Sample
from simharness.scenario.sections.detector import KINDS
from simharness.statistics.bootstrap import block_weights, blocks, interval, resampled

RESAMPLES = 500

_NEVER = 3.0
"""What never happened in n trials has a chance of at most 3 / n, at 95 %. Trials that last count as so many fewer."""

_OF = {
    "keypoints.stray": "miss.n",
    "boxes": "people.n",
    "boxes.duplicates": "people.found",
    "phantoms": "false.n",
    "size": "size.n",
    "size.fragments": "fragments.n",
}
"""The sums that say of how many a figure is; the others are of all joints in the picture."""

_SIGHTS = ("visible", "self_occluded", "occluded")


@dataclass(frozen=True)
class Figure:
    """One measured figure; NaN where nothing is known.

    Attributes:
        value: measured on all frames.
        low, high: of its 95 % interval.
        count: of how many joints, people or pictures.
    """

    value: float
    low: float
    high: float
    count: int

    @property
    def known(self) -> bool:
        """Whether anything was there to measure it on."""
        return bool(np.isfinite(self.value))

    def agrees(self, other: Figure) -> bool:
        """Whether two figures differ by no more than both intervals allow together, each on the side that faces
        the other: the interval of the difference of two independent figures.
        """
        first, second = (self, other) if self.value <= other.value else (other, self)
        room = np.hypot(first.high - first.value, second.value - second.low)
        return bool(second.value - first.value <= room + 1e-12)


@dataclass(frozen=True)
class Measurement:
    """What was measured of a detector.

    Attributes:
        name: of the sample.
        frames: how many.
        people: mean number of known people in a frame.
        figures: by key of ``[detector]``; beside those ``bias.forward.``, ``bias.outward.`` and ``bias.up.`` with the
            kind of joint, and ``size.``.
    """

    name: str
    frames: int
    people: float
    figures: Mapping[str, Figure]

    def __getitem__(self, key: str) -> Figure:
        """The figure of a key."""
        return self.figures[key]

    def summary(self) -> dict[str, Any]:
        """JSON-ready: what is not known is null."""
        return {
            "name": self.name,
            "frames": self.frames,
            "people": self.people,
            "level": 0.95,
            "figures": {
                key: {
                    "value": _number(each.value),
                    "low": _number(each.low),
                    "high": _number(each.high),
                    "n": each.count,
                }
                for key, each in self.figures.items()
            },
        }


def measure(sample: Sample, *, resamples: int = RESAMPLES, seed: int = 0) -> Measurement:
    """Measure a detector.

    Intervals are of a block bootstrap over time (:mod:`simharness.statistics.bootstrap`). They tell what another
    recording of the same people at the same work could have given, with the bias as it was measured; not what
    others would.

    Args:
        sample: people whose joints are known, and what the detector found of them.
        resamples: of the bootstrap.
        seed: of its draws.

    Raises:
        ValueError: a sample without a known person, or in which no detection shows one.
    """
    if not sample.known.any():
        raise ValueError(f"{sample.name}: nobody's joints are known in any of {len(sample)} frames; nothing to measure")
    judged = judge(sample)
    if not judged.association.found.any():
        raise ValueError(
            f"{sample.name}: no detection is near any of the known people; expected detections of the same frames and "
            "cameras as the truth. Check that calibration, truth and detections belong together"
        )
    sums = count(judged)
    whole = figures({key: each.sum(axis=0, keepdims=True) for key, each in sums.items()}, step=judged.step)
    weights = block_weights(sample.time, resamples=resamples, seed=seed)
    drawn = figures({key: resampled(each, weights) for key, each in sums.items()}, step=judged.step)
    independent = blocks(sample.time)
    result = {}
    design = 1 + 2 * np.nan_to_num(whole["correlation.life"][0]) / judged.step
    for key, value in whole.items():
        low, high = interval(drawn[key], blocks=independent)
        n = _count(key, sums)
        if key.split(".")[1] in CLASSES and value[0] < _NEVER * design / max(n, 1):
            high = np.fmax(high, min(1.0, _NEVER * design / max(n, 1)))
        # A percentile interval need not hold the figure itself, where a bound such as zero is near.
        result[key] = Figure(float(value[0]), float(np.fmin(low, value[0])), float(np.fmax(high, value[0])), n)
    return Measurement(sample.name, len(sample), float(sample.known.sum() / len(sample)), result)


def _count(key: str, sums: Sums) -> int:
    """Of how many joints, people or pictures a figure is."""
    section, *rest = key.split(".")
    kind = KINDS.index(rest[-1]) if rest[-1] in KINDS else None
    if rest[0] in CLASSES and kind is not None:
        n = sums[f"n.{rest[0]}"][..., kind].sum(axis=0)
        return int(n[_SIGHTS.index(rest[1])] if rest[1] in _SIGHTS else n.sum())
    if section == "scores":
        scores = sums["scores"] if kind is None else sums["scores"][..., kind, :]
        return int((scores[:, :, SCORED.index(rest[0])] if rest[0] in SCORED else scores).sum())
    if kind is not None:
        return int(sums["scatter.n"][:, kind].sum())
    return int(sums[_OF.get(key, _OF.get(section, "n.drop"))].sum())


def _number(value: float) -> float | None:
    return None if not np.isfinite(value) else float(value)
