"""Points from viewing rays, residuals in pixels, and people as estimates: what all methods of this folder share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose import COCO17, Estimate
from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.skeleton import Skeleton

LEAST_JOINTS = 7
"""Fewest joints of a person: on the held-out scenes, the most with which no method loses PCP."""

BEHIND = 1e9
"""Residual in pixels of a point that is behind a camera."""


@njit(cache=True)
def nearest_point(origins: Floats, directions: Floats, weights: Floats, point: Floats) -> bool:
    """Write the point nearest to rays, by weighted least squares of distances; return whether it is determined.

    Distances are weighted once more by the depth of the first solution, so that they become residuals in pictures.

    Args:
        origins: (n, 3), metres.
        directions: unit vectors, (n, 3).
        weights: (n,); a ray of weight 0 is not used.
        point: receives the point, (3,), metres.
    """
    for step in range(2):
        xx, xy, xz, yy, yz, zz, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(len(weights)):
            if weights[k] <= 0.0:
                continue
            share = weights[k]
            ox, oy, oz = origins[k, 0], origins[k, 1], origins[k, 2]
            dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
            if step:
                depth = (point[0] - ox) * dx + (point[1] - oy) * dy + (point[2] - oz) * dz
                share /= max(depth, 0.1) ** 2
            along = ox * dx + oy * dy + oz * dz
            xx += share * (1.0 - dx * dx)
            yy += share * (1.0 - dy * dy)
            zz += share * (1.0 - dz * dz)
            xy -= share * dx * dy
            xz -= share * dx * dz
            yz -= share * dy * dz
            bx += share * (ox - along * dx)
            by += share * (oy - along * dy)
            bz += share * (oz - along * dz)
        cx, cy, cz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy  # cofactors of the first row
        determinant = xx * cx + xy * cy + xz * cz
        trace = xx + yy + zz
        if not determinant > 1e-9 * trace**3:
            return False
        point[0] = (cx * bx + cy * by + cz * bz) / determinant
        point[1] = (cy * bx + (xx * zz - xz * xz) * by + (xy * xz - xx * yz) * bz) / determinant
        point[2] = (cz * bx + (xy * xz - xx * yz) * by + (xx * yy - xy * xy) * bz) / determinant
    return True


@njit(cache=True)
def pixel_error(origin: Floats, direction: Floats, pixel: float, point: Floats) -> float:
    """Return the distance of a keypoint from the image of a point, pixels of the image centre; :data:`BEHIND` if none.

    Args:
        origin: optical centre, (3,), metres.
        direction: viewing ray of the keypoint, unit vector (3,).
        pixel: angle of a pixel at the image centre, radians.
        point: (3,), metres.
    """
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    depth = x * direction[0] + y * direction[1] + z * direction[2]
    if depth <= 0.0:
        return 1e9
    return float(np.sqrt(max(x * x + y * y + z * z - depth * depth, 0.0)) / (depth * pixel))


@njit(cache=True)
def ray_distance(origin: Floats, direction: Floats, other_origin: Floats, other_direction: Floats) -> float:
    """Return the distance of two lines, metres; of parallel lines that of a point of one to the other."""
    nx = direction[1] * other_direction[2] - direction[2] * other_direction[1]
    ny = direction[2] * other_direction[0] - direction[0] * other_direction[2]
    nz = direction[0] * other_direction[1] - direction[1] * other_direction[0]
    x, y, z = other_origin[0] - origin[0], other_origin[1] - origin[1], other_origin[2] - origin[2]
    norm = np.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 1e-6:
        along = x * direction[0] + y * direction[1] + z * direction[2]
        return float(np.sqrt(max(x * x + y * y + z * z - along * along, 0.0)))
    return float(abs(x * nx + y * ny + z * nz) / norm)


def estimate_of(
    joints: Sequence[Floats] | Floats, scores: Sequence[Floats] | Floats, labels: Integers, skeleton: Skeleton = COCO17
) -> Estimate:
    """Return an estimate of the people with at least :data:`LEAST_JOINTS` joints, with labels numbered to match.

    Args:
        joints: (n, J, 3), metres; NaN for a joint that was not placed.
        scores: confidence of joints, 0 to 1, (n, J).
        labels: person of each detection, 0 to n - 1, or -1, (m,).
        skeleton: the J joints.
    """
    placed = np.reshape(np.asarray(joints, float), (-1, len(skeleton), 3))
    kept = np.isfinite(placed[..., 0]).sum(axis=1) >= LEAST_JOINTS
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    certain = np.clip(np.nan_to_num(np.reshape(np.asarray(scores, float), (-1, len(skeleton)))), 0.0, 1.0)
    return Estimate.of_joints(placed[kept], scores=certain[kept], labels=number[labels], skeleton=skeleton)
