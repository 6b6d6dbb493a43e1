"""What each camera sees beside what the other cameras see: the residuals that show which camera is wrong.

A joint that is triangulated from all cameras hides a part of the error of each. So each camera is compared with the
joint as the others see it.
"""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.sightings import Sightings
from mvpose.camera import Rig

_STEPS = 4  # of reweighting
_SCALE = 0.05  # metres; distance of a ray from its joint beyond which it counts for less (Cauchy's weights)
_ANCHOR = 1e-9  # of the information in all directions: joints that rays do not determine stay finite
_LEAST_PARALLAX = 0.002  # smallest over largest eigenvalue of the information; two rays at 5 degrees have that
_LEAST_OTHERS = 2  # views that place the joint


@dataclass(frozen=True)
class Missing:
    """Residuals of k sightings from the other views."""

    offset: Floats
    """Detected minus expected, (k, 2), pixels; NaN where fewer than two other views see the joint, or do not determine
    its place."""
    point: Floats
    """Joint by all views, (k, 3), metres, in the world; NaN where fewer than two views see it."""


def leave_one_out(rig: Rig, sightings: Sightings, *, offsets: Floats | None = None) -> Missing:
    """Return how far each sighting is from where the other cameras see the joint.

    Args:
        rig: V cameras.
        sightings: k sightings.
        offsets: what to add to the times of each camera, (V,), seconds; keypoints are moved along their velocity to the
            time that the clock of the camera states. None: clocks are right.
    """
    pixels = sightings.pixels
    if offsets is not None and sightings.velocity is not None:
        pixels = pixels - sightings.velocity * offsets[sightings.view, None]
    rows, directions, seen = _rays(rig, sightings, pixels)
    with np.errstate(invalid="ignore", divide="ignore"):
        all_views, information, target = _triangulated(rig.centers, directions, seen)
    offset = np.full((len(sightings), 2), np.nan)
    for view, camera in enumerate(rig):
        here = np.flatnonzero(sightings.view == view)
        row = rows[here]
        others = seen[row].sum(axis=1) - 1 >= _LEAST_OTHERS
        here, row = here[others], row[others]
        rest = information[row].sum(axis=1) - information[row, view], target[row].sum(axis=1) - target[row, view]
        point = _solved(*rest)
        offset[here] = pixels[here] - camera.project(point)
    return Missing(offset, all_views[rows])


def _rays(rig: Rig, sightings: Sightings, pixels: Floats) -> tuple[Integers, Floats, Bools]:
    """Return the point of each sighting, (k,), directions to N points from V views, (N, V, 3), and a mask, (N, V)."""
    rows, count = sightings.points
    directions, seen = np.zeros((count, len(rig), 3)), np.zeros((count, len(rig)), bool)
    for view, camera in enumerate(rig):
        here = np.flatnonzero(sightings.view == view)
        rays = camera.rays(pixels[here])
        known = np.isfinite(rays).all(axis=1)
        directions[rows[here[known]], view], seen[rows[here[known]], view] = rays[known], True
    return rows, directions, seen


def _triangulated(centers: Floats, directions: Floats, seen: Bools) -> tuple[Floats, Floats, Floats]:
    """Triangulate robustly from all views.

    Args:
        centers: (V, 3), metres.
        directions: unit vectors, (N, V, 3).
        seen: which views see the point, (N, V).

    Returns:
        Points, (N, 3), metres; and with the weights of the last step the information and the target of each view,
        (N, V, 3, 3) and (N, V, 3), whose sums over views give the point.
    """
    across = np.eye(3) - directions[..., :, None] * directions[..., None, :]
    weight = seen.astype(float)
    for _ in range(_STEPS):
        information = weight[..., None, None] * across
        target = (information @ centers[None, :, :, None])[..., 0]
        points = _solved(information.sum(axis=1), target.sum(axis=1))
        miss2 = ((across @ (points[:, None] - centers)[..., None])[..., 0] ** 2).sum(axis=-1)
        weight = np.where(seen, 1.0 / (1.0 + np.nan_to_num(miss2, nan=np.inf) / _SCALE**2), 0.0)
    return np.where((seen.sum(axis=1) >= _LEAST_OTHERS)[:, None], points, np.nan), information, target


def _solved(information: Floats, target: Floats) -> Floats:
    """Return the points of (N, 3, 3) and (N, 3), metres; NaN where the rays are nearly parallel."""
    values = np.linalg.eigvalsh(information) if len(information) else np.zeros((0, 3))
    fixed = values[:, 0] > _LEAST_PARALLAX * values[:, 2]
    points = np.full(target.shape, np.nan)
    points[fixed] = np.linalg.solve(information[fixed] + _ANCHOR * np.eye(3), target[fixed][..., None])[..., 0]
    return points


def mean_field(
    pixels: Floats, offset: Floats, *, size: tuple[int, int], columns: int = 8, least: int = 12
) -> tuple[Floats, Floats]:
    """Return the median offset in each cell of a grid over the picture, without cells of too few sightings.

    Args:
        pixels: places in the picture, (k, 2).
        offset: offsets, (k, 2), pixels; NaN ones do not count.
        size: width and height of the picture, pixels.
        columns: cells in a row; cells are squares.
        least: sightings that a cell needs.

    Returns:
        Mean places (c, 2) and median offsets (c, 2), pixels.
    """
    edge = size[0] / columns
    cell = np.floor((pixels + 0.5) / edge).astype(np.int64)
    rows = int(np.ceil(size[1] / edge))
    inside = (cell >= 0).all(axis=1) & (cell[:, 0] < columns) & (cell[:, 1] < rows) & np.isfinite(offset).all(axis=1)
    index = (cell[:, 1] * columns + cell[:, 0])[inside]
    pixels, offset = pixels[inside], offset[inside]
    held = [np.flatnonzero(index == each) for each in np.unique(index)]
    held = [each for each in held if len(each) >= least]
    places = np.array([pixels[each].mean(axis=0) for each in held]).reshape(-1, 2)
    return places, np.array([np.median(offset[each], axis=0) for each in held]).reshape(-1, 2)
