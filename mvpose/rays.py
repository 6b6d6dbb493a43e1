"""Viewing rays of detections in the world, the input of every later stage.

A keypoint and its camera define a half-line on which the joint lies. Distances between such rays, and from a point to
a ray, are in metres for any resolution, focal length and lens, so one set of scales serves every rig.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import seal
from mvpose.detections import MOST_DETECTIONS, Detections
from mvpose.heatmaps import Heatmaps
from mvpose.kernels import njit
from mvpose.lens import undistort
from mvpose.ordering import canonical_order

_MODES = 3  # modes read per heat map: the joint, its left-right counterpart, and the joint of a neighbour


@dataclass(frozen=True, slots=True)
class Modes:
    """Modes of the heat maps of m detections as rays, and the maps with the cameras needed to sample them."""

    directions: Floats
    """Unit vectors to the modes of each map, strongest first, (m, J, K, 3); zeros where there are fewer."""
    weights: Floats
    """Heights of the modes, at most 1, (m, J, K); 0 where there are fewer."""
    row: Integers
    """Row of each detection in ``values``, (m,)."""
    values: NDArray[np.float32]
    """Heat maps of all detections of the frame, (M, J, h, w)."""
    grid: Floats
    """Origin and stride of the maps of each detection, x and y, pixels, (m, 4)."""
    cameras: Floats
    """Camera of each detection, as :attr:`mvpose.camera.Rig.packed`, (m, 22)."""

    def select(self, which: Bools | Integers) -> "Modes":
        """Return the modes of some detections; all maps stay where they are, because copies would take long."""
        directions, weights, row = self.directions[which], self.weights[which], self.row[which]
        return Modes(directions, weights, row, self.values, self.grid[which], self.cameras[which])


@dataclass(frozen=True, slots=True)
class Rays:
    """Viewing rays of m detections with J joints."""

    view: Integers
    """Camera of each detection, (m,)."""
    origins: Floats
    """Optical centres, (m, 3), metres."""
    directions: Floats
    """Unit vectors, (m, J, 3); zeros where the keypoint is missing."""
    weights: Floats
    """Scores of the keypoints, (m, J); 0 where missing."""
    pixel: Floats
    """Angle of one pixel at the image centre, (m,), radians."""
    modes: Modes | None = None
    """Modes of the heat maps, or None."""

    def __len__(self) -> int:
        return len(self.view)

    def select(self, which: Bools | Integers) -> "Rays":
        """Return the rays of some detections, given by a mask (m,) or by indices in a new order."""
        if which.dtype == np.bool_:
            which = np.flatnonzero(which)
        modes = None if self.modes is None else self.modes.select(which)
        view = self.view.take(which)
        seal(view)
        origins, directions, weights = _select(self.origins, self.directions, self.weights, which)
        return Rays(view, origins, directions, weights, self.pixel.take(which), modes)


@njit(cache=True)
def _select(origins, directions, weights, which):
    """Return rows of three arrays, faster than by NumPy for few rows."""
    return origins[which], directions[which], weights[which]


def viewing_rays(rig: Rig, detections: Detections) -> Rays:
    """Convert keypoints to viewing rays, with lens distortion removed.

    A keypoint at which the lens images no direction (far outside the picture of a distorting lens) is missing.

    Raises:
        ValueError: an argument of another type, a detection in a view that the rig does not have, or more than
            :data:`mvpose.detections.MOST_DETECTIONS` detections.
    """
    _check(rig, detections)
    origins, directions, weights, pixel, last = _viewing_rays(
        rig.packed, detections.view, detections.keypoints, detections.scores
    )
    _check_views(rig, last)
    modes = None if detections.likelihoods is None else _modes(rig, detections, detections.likelihoods)
    return Rays(detections.view, origins, directions, weights, pixel, modes)


def ordered_rays(rig: Rig, detections: Detections) -> tuple[Integers, Rays]:
    """Return the canonical order of the detections (:func:`mvpose.ordering.canonical_order`) and their rays in it.

    Raises:
        ValueError: as :func:`viewing_rays`.
    """
    _check(rig, detections)
    order, view, origins, directions, weights, pixel, last = _ordered_rays(
        rig.packed, detections.view, detections.keypoints, detections.scores, detections.box_scores
    )
    _check_views(rig, last)
    seal(view)
    modes = None if detections.likelihoods is None else _modes(rig, detections, detections.likelihoods).select(order)
    return order, Rays(view, origins, directions, weights, pixel, modes)


def _check(rig: Rig, detections: Detections) -> None:
    for value, kind in ((rig, Rig), (detections, Detections)):
        if not isinstance(value, kind):
            raise ValueError(
                f"expected a mvpose.{kind.__name__}, got {type(value).__name__}: estimate(rig, detections)"
            )
    if len(detections) > MOST_DETECTIONS:
        raise ValueError(
            f"a frame must have at most {MOST_DETECTIONS} detections, got {len(detections)}; pass one frame at a time, "
            "or drop detections with low scores"
        )


def _check_views(rig: Rig, last: int) -> None:
    if last >= len(rig):
        raise ValueError(
            f"a detection names view {last}, but the rig has {len(rig)} cameras (0 to {len(rig) - 1}); "
            "pass the rig that the detections were made with, its cameras in that order"
        )


def _modes(rig: Rig, detections: Detections, maps: Heatmaps) -> Modes:
    view = detections.view
    pixels, heights = maps.modes(_MODES)
    heights = np.where(detections.detected[..., None], heights, 0.0)  # a missing keypoint overrides its heat map
    m, joints = heights.shape[:2]
    flat = pixels.reshape(m, joints * _MODES, 2), np.minimum(heights, 1.0).reshape(m, joints * _MODES)
    _, directions, weights, _, _ = _viewing_rays(rig.packed, view, *flat)
    return Modes(
        directions.reshape(m, joints, _MODES, 3),
        weights.reshape(m, joints, _MODES),
        np.arange(m),
        maps.values,
        np.hstack([maps.origin, maps.stride]),
        rig.packed[view],
    )


@njit(cache=True)
def _ordered_rays(cameras, view, keypoints, scores, box_scores):
    """Return the canonical order, and in it the fields of :class:`Rays`; last the greatest view."""
    origins, directions, weights, pixel, last = _viewing_rays(cameras, view, keypoints, scores)
    order = canonical_order(keypoints, weights, box_scores)
    return order, view[order], origins[order], directions[order], weights[order], pixel[order], last


@njit(cache=True)
def _viewing_rays(cameras, view, keypoints, scores):
    """Return the fields of :class:`Rays` and the greatest view; detections in a view without a camera have no rays."""
    m, joints = scores.shape
    last = -1
    origins, directions = np.empty((m, 3)), np.zeros((m, joints, 3))
    weights, pixel = np.zeros((m, joints)), np.empty(m)
    for d in range(m):
        last = max(last, view[d])
        if view[d] >= len(cameras):
            continue
        camera = cameras[view[d]]  # see Rig.packed
        fx, skew, cx, fy, cy, lens = camera[0], camera[1], camera[2], camera[3], camera[4], camera[17:22]
        for r in range(3):
            origins[d, r] = camera[14 + r]
        pixel[d] = 1.0 / np.sqrt(fx * fy)
        bent = False
        for k in range(len(lens)):
            bent = bent or lens[k] != 0.0
        for j in range(joints):
            if not scores[d, j] > 0.0:
                continue
            v = (keypoints[d, j, 1] - cy) / fy
            u = (keypoints[d, j, 0] - cx - skew * v) / fx
            x, y = undistort(u, v, lens) if bent else (u, v)
            if not abs(x) + abs(y) < 1e6:  # NaN, or a ray parallel to the image plane
                continue
            scale = 1.0 / np.sqrt(x * x + y * y + 1.0)
            for r in range(3):  # transposed R times (x, y, 1)
                directions[d, j, r] = (camera[5 + r] * x + camera[8 + r] * y + camera[11 + r]) * scale
            weights[d, j] = scores[d, j]
    return origins, directions, weights, pixel, last
