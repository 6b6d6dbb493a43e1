"""Measures of the benchmark: PCP of estimates, and how far cameras are from where they should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Detections, Estimate, Rig, preset
from mvpose.arrays import Floats
from mvpose.estimators import Estimator, SequenceEstimator
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pcp import percent


def pcp(
    rig: Rig, frames: Sequence[Detections], truth: Floats, *, variant: str = "fast", every: int = 1, period: float
) -> float:
    """Return the mean of the PCP of all people, 0 to 100.

    Args:
        rig: calibration.
        frames: detections, F.
        truth: joints on SHELF14, (F, P, 14, 3), metres; frame k is at k times the period.
        variant: preset of the pipeline.
        every: every how many frames are estimated, by a variant without memory.
        period: time between frames without times, seconds.
    """
    estimator: Estimator = preset(variant, period=period)
    if isinstance(estimator, SequenceEstimator):
        every, estimates = 1, list(estimator.track(rig, frames))
    else:
        estimates = [estimator.estimate(rig, each) for each in frames[::every]]
    pairs = enumerate(zip(frames[::every], estimates, strict=True))
    moved = np.stack([_truth_at(truth, k * every, given, each, period) for k, (given, each) in pairs])
    parts = score_frames(moved, [each.joints for each in estimates]).parts
    scores = [percent(parts[:, person]) for person in range(parts.shape[1])]
    return float(np.mean([each for each in scores if each is not None]))


def _truth_at(truth: Floats, frame: int, given: Detections, estimate: Estimate, period: float) -> Floats:
    """Return the true joints, (P, 14, 3), at the time of an estimate, which is that of the latest picture."""
    if given.time is None or estimate.time is None:
        return truth[frame]
    place = float(np.clip(estimate.time / period, 0, len(truth) - 1))
    before = min(int(place), len(truth) - 2)
    return truth[before] + (place - before) * (truth[before + 1] - truth[before])


def aligned(rig: Rig, true: Rig, *, resized: bool = False) -> Rig:
    """Return the rig, turned and shifted as a whole so that its cameras stand as near as they can to the true ones.

    With ``resized`` it is also given the size of the true one.
    """
    turn = Rotation.from_matrix([b.R.T @ a.R for a, b in zip(rig, true, strict=True)]).mean().as_matrix()
    centers = rig.centers @ turn.T
    have, want = centers - centers.mean(0), true.centers - true.centers.mean(0)
    size = (have * want).sum() / (have**2).sum() if resized else 1.0
    centers = size * centers + (true.centers - size * centers).mean(axis=0)
    poses = zip(rig, centers, strict=True)
    return Rig([replace(camera, R=camera.R @ turn.T, t=-camera.R @ turn.T @ center) for camera, center in poses])


def camera_errors(rig: Rig, true: Rig) -> tuple[Floats, Floats]:
    """Return how far each camera is turned, (V,), degrees, and shifted, (V,), metres, from where it truly stands."""
    turns = Rotation.from_matrix([a.R @ b.R.T for a, b in zip(rig, true, strict=True)]).magnitude()
    return np.degrees(turns), np.linalg.norm(rig.centers - true.centers, axis=1)
