"""Estimation after repair: the rig and the clocks are corrected from the whole recording, then people are estimated."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Integers
from mvpose.calibration.clocks import estimate_clocks
from mvpose.calibration.repair import repair
from mvpose.calibration.resampling import resampled
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.estimators import Estimator, SequenceEstimator


@dataclass(frozen=True)
class RepairedPipeline:
    """Estimator of recordings (:class:`mvpose.estimators.SequenceEstimator`) that repairs the rig first.

    All frames are read before the first estimate. The repaired rig is used where the repair is not refused; its size is
    that of the believed calibration and of bone lengths together. Clocks are corrected where one is an alarm: an
    estimator with memory gets the corrected times of pictures, an estimator of single frames gets detections that are
    moved to the times of the frames.

    Attributes:
        estimator: what estimates people.
        period: time between frames whose detections carry no time, seconds.
    """

    estimator: Estimator
    period: float = 0.04

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame alone, without repair: one frame does not determine the calibration."""
        return self.estimator.estimate(rig, detections)

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Repair the rig and the clocks, then yield the estimates (:class:`mvpose.estimators.SequenceEstimator`)."""
        given = list(frames)
        if not given:
            return
        rig = repair(rig, given, period=self.period, size="both").rig
        clocks = estimate_clocks(rig, given, period=self.period)
        wrong = any(each.severity == "alarm" for each in clocks.findings())
        if isinstance(self.estimator, SequenceEstimator):
            yield from self.estimator.track(rig, clocks.corrected(given) if wrong else given)
        elif not wrong:
            yield from (self.estimator.estimate(rig, each) for each in given)
        else:
            moved = resampled(rig, given, clocks)
            for each, rows in zip(moved.frames, moved.rows, strict=True):
                yield _of_given(self.estimator.estimate(rig, each), rows, len(each))


def _of_given(estimate: Estimate, rows: Integers, count: int) -> Estimate:
    """Return the estimate with labels of the detections that were given.

    Args:
        estimate: estimate of ``count`` moved detections.
        rows: the moved detection of each given one, -1 for none.
        count: number of moved detections.
    """
    labels = np.append(estimate.matching.labels_of(count), -1)[rows]  # row -1 is the last
    return replace(estimate, matching=replace(estimate.matching, labels=labels, P=None))
