"""Measures of the benchmark: PCP of estimates, and how far cameras are from where they should be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Detections, Pipeline, Rig
from mvpose.arrays import Floats
from mvpose.pipeline import Estimator, SequenceEstimator
from mvpose.skeleton import coco17_to_shelf14
from simharness.scoring.pcp import percent, score_parts


def pcp(
    rig: Rig, frames: Sequence[Detections], truth: Floats, *, variant: str = "fast", every: int = 1, period: float
) -> float:
    """Return the mean of the PCP of all people, 0 to 100.

    Args:
        rig: calibration.
        frames: detections, F.
        truth: joints on SHELF14, (F, P, 14, 3), metres.
        variant: preset of the pipeline.
        every: every how many frames are estimated, by a variant without memory.
        period: time between frames without times, seconds.
    """
    estimator: Estimator = Pipeline.preset(variant, period=period)
    if isinstance(estimator, SequenceEstimator):
        every, estimates = 1, list(estimator.track(rig, frames))
    else:
        estimates = [estimator.estimate(rig, each) for each in frames[::every]]
    parts = np.stack(
        [
            score_parts(true, coco17_to_shelf14(each.joints))
            for true, each in zip(truth[::every], estimates, strict=True)
        ]
    )
    scores = [percent(parts[:, person]) for person in range(parts.shape[1])]
    return float(np.mean([each for each in scores if each is not None]))


def camera_errors(rig: Rig, true: Rig, *, aligned: bool) -> tuple[Floats, Floats]:
    """Return how far each camera is turned, (V,), degrees, and shifted, (V,), metres.

    Args:
        rig: a calibration.
        true: the right one.
        aligned: do not count a turn and a shift of the whole rig, which nobody can see from its pictures.
    """
    turn, shift = np.eye(3), np.zeros(3)
    if aligned:
        turn = Rotation.from_matrix([b.R.T @ a.R for a, b in zip(rig, true, strict=True)]).mean().as_matrix()
        shift = (true.centers - rig.centers @ turn.T).mean(axis=0)
    turns = Rotation.from_matrix([a.R @ turn.T @ b.R.T for a, b in zip(rig, true, strict=True)]).magnitude()
    shifts = np.linalg.norm(rig.centers @ turn.T + shift - true.centers, axis=1)
    return np.degrees(turns), shifts
