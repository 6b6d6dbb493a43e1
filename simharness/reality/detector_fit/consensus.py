"""Consensus of the views: where the detections of the other views place each joint.

A detector is measured against its own consensus, not against a truth that people made: published truth is off by two to
four centimetres, and errors measured against it contain this error in every view. The place of a joint in one view is
predicted from the other views alone (leave-one-out), and the noise of the prediction is removed from the residual. What
all views share, a bias of the detector, cannot be seen in this way; it is found beside the annotation.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from mvpose import Rig
from mvpose.arrays import Bools, Floats
from simharness.types.random_streams import stream

INLIER = 1.5
"""Largest distance of a keypoint from the consensus it supports, in units of OKS sigma x sqrt(area)."""

_MOST_PAIRS = 40  # pairs of views tried as the start of a consensus
_ROUNDS = 3  # of the linear solution, which is weighted by the depths of the round before
_NEAREST = 0.1  # metres: smallest depth


@dataclass(frozen=True)
class Consensus:
    """Joints on which the views agree."""

    joints: Floats
    """Joints from all views that agree, (T, P, 17, 3) metres; NaN with fewer than two."""
    agrees: Bools
    """Which keypoints support the consensus, (T, V, P, 17)."""
    predicted: Floats
    """Joints from the other views that agree, projected into each view, (T, V, P, 17, 2) pixels; NaN with fewer than
    two other views."""
    noise: Floats
    """Variance of the prediction per axis, (T, V, P, 17), as a multiple of the variance of a keypoint, both in units of
    OKS sigma x sqrt(area); NaN where not reported or not predicted."""
    variance: Floats
    """Variance of the joints per axis if keypoints are off by one unit (standard deviation), (T, P, 17) square metres;
    NaN with fewer than two views."""
    scale: Floats
    """Mean square size of one unit at the joint over the views that agree, (T, P, 17) square metres."""


def find_consensus(rig: Rig, keypoints: Floats, unit: Floats) -> Consensus:
    """Find the consensus of the views, and that of the other views for each view.

    The pair of views with the least truncated cost over all views decides which views agree.

    Args:
        rig: the V cameras.
        keypoints: (T, V, P, 17, 2) pixels; NaN where not reported.
        unit: OKS sigma x sqrt(area), (T, V, P, 17) pixels; 0 where the person is not in the picture.
    """
    lines = _lines(rig, np.moveaxis(keypoints, 1, -2))
    unit = np.moveaxis(unit, 1, -1)
    known = np.isfinite(keypoints[..., 0]) & np.isfinite(np.moveaxis(unit, -1, 1)) & (np.moveaxis(unit, -1, 1) > 0)
    known = np.moveaxis(known, 1, -1)
    weight = np.where(known, 1 / np.where(known, unit, 1.0) ** 2, 0.0)

    best, agrees = np.full(known.shape[:-1], np.inf), np.zeros_like(known)
    for pair in _pairs(len(rig)):
        chosen = np.zeros(len(rig), bool)
        chosen[list(pair)] = True
        both = known[..., chosen].all(axis=-1)
        if not both.any():
            continue
        joints, _ = _solve(lines[both], weight[both] * chosen)
        far = _residuals(lines[both], joints) * np.sqrt(weight[both])
        cost = np.where(known[both], np.minimum(far, INLIER) ** 2, 0.0).sum(axis=-1)
        better = cost < best[both]
        rows = tuple(index[better] for index in np.nonzero(both))
        best[rows] = cost[better]
        agrees[rows] = (far[better] < INLIER) & known[rows]

    predicted, noise = np.full((*known.shape, 2), np.nan), np.full(known.shape, np.nan)
    joints, information = _solve(lines, weight * agrees)
    for view, camera in enumerate(rig):
        others = agrees.copy()
        others[..., view] = False
        enough = others.sum(axis=-1) >= 2
        if enough.any():
            place, left = _solve(lines[enough], weight[enough] * others[enough])
            predicted[enough, view] = camera.project(place)
            ray = lines[enough][..., view, :2, :3]
            spread = ((ray @ np.linalg.inv(left)) * ray).sum(axis=(-1, -2))
            depth = np.maximum(_depth(lines[enough], place)[..., view], _NEAREST)
            noise[enough, view] = np.where(known[enough, view], spread / depth**2 / 2 * weight[enough, view], np.nan)
    few = agrees.sum(axis=-1) < 2
    variance = np.trace(np.linalg.inv(information), axis1=-2, axis2=-1) / 3
    focal = np.array([np.sqrt(camera.K[0, 0] * camera.K[1, 1]) for camera in rig])
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.where(agrees, (unit * _depth(lines, joints) / focal) ** 2, 0.0).sum(axis=-1) / agrees.sum(axis=-1)
    joints[few], variance[few], size[few] = np.nan, np.nan, np.nan
    return Consensus(
        joints, np.moveaxis(agrees, -1, 1), np.moveaxis(predicted, -2, 1), np.moveaxis(noise, -1, 1), variance, size
    )


def _pairs(views: int) -> list[tuple[int, int]]:
    """Return pairs of views, all of them or a fixed random choice."""
    every = list(combinations(range(views), 2))
    if len(every) <= _MOST_PAIRS:
        return every
    return [every[index] for index in sorted(stream(0, "consensus").permutation(len(every))[:_MOST_PAIRS])]


def _lines(rig: Rig, keypoints: Floats) -> Floats:
    """Return the equations of the viewing rays of keypoints (..., V, 2), (..., V, 3, 4).

    Two rows vanish for points on the ray, in pixels times depth; the third gives the depth.
    """
    result = np.zeros((*keypoints.shape[:-1], 3, 4))
    for view, camera in enumerate(rig):
        straight = camera.undistort(keypoints[..., view, :])
        P = camera.P
        result[..., view, 0, :] = straight[..., 0, None] * P[2] - P[0]
        result[..., view, 1, :] = straight[..., 1, None] * P[2] - P[1]
        result[..., view, 2, :] = P[2]
    return np.where(np.isfinite(result).all(axis=(-1, -2), keepdims=True), result, 0.0)


def _solve(lines: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Return the points (..., 3) nearest to viewing rays, and their information matrices, (..., 3, 3).

    Args:
        lines: equations, (..., V, 3, 4).
        weight: inverse variances, (..., V) per square pixel.
    """
    depth = np.ones(weight.shape)
    views = weight.shape[-1]
    rows = lines[..., :2, :].reshape(*weight.shape[:-1], 2 * views, 4)
    eye = np.eye(3)
    for _ in range(_ROUNDS):
        weighted = np.repeat(weight / depth**2, 2, axis=-1)[..., None] * rows
        normal = np.swapaxes(rows[..., :3], -1, -2) @ weighted  # (..., 3, 4)
        A, b = normal[..., :3], -normal[..., 3]
        trace = np.trace(A, axis1=-2, axis2=-1)[..., None, None]
        A = A + np.where(trace > 0, 1e-12 * trace, 1.0) * eye
        point = np.asarray(np.linalg.solve(A, b[..., None])[..., 0], float)
        depth = np.maximum(_depth(lines, point), _NEAREST)
    return point, np.asarray(A, float)


def _depth(lines: Floats, points: Floats) -> Floats:
    """Return the depths (..., V) of points (..., 3)."""
    return np.einsum("...vk,...k->...v", lines[..., 2, :3], points) + lines[..., 2, 3]


def _residuals(lines: Floats, points: Floats) -> Floats:
    """Return the distances (..., V) of points (..., 3) from viewing rays, pixels."""
    away = np.einsum("...vik,...k->...vi", lines[..., :2, :3], points) + lines[..., :2, 3]
    return np.linalg.norm(away, axis=-1) / np.maximum(_depth(lines, points), _NEAREST)
