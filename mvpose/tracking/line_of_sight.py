"""Where people stand as a camera sees them: their depth, who stands before whom, and who is in the image."""

from __future__ import annotations

import numpy as np

from mvpose.kernels import njit


@njit(cache=True, borrows=True)
def depth_of(camera, point):
    """Return the distance of a point along the optical axis."""
    depth = 0.0
    for r in range(3):
        depth += camera[11 + r] * (point[r] - camera[14 + r])
    return depth


@njit(cache=True, borrows=True)
def beside(camera, point, nearer):
    """Return the distance of a nearer point from the line of sight to a point."""
    square, along, reach = 0.0, 0.0, 0.0
    for r in range(3):
        a, b = point[r] - camera[14 + r], nearer[r] - camera[14 + r]
        reach += a * a
        along += a * b
        square += b * b
    return np.sqrt(max(square - along * along / max(reach, 1e-12), 0.0))


@njit(cache=True, borrows=True)
def in_image(camera, size, state):
    """Return whether most joints of a person lie in the image; distortion is left out."""
    inside, known = 0, 0
    for j in range(len(state)):
        if np.isnan(state[j, 0]):
            continue
        known += 1
        z = depth_of(camera, state[j])
        if z <= 0.0:
            continue
        x, y = 0.0, 0.0
        for r in range(3):
            offset = state[j, r] - camera[14 + r]
            x += camera[5 + r] * offset
            y += camera[8 + r] * offset
        u, v = camera[0] * x / z + camera[1] * y / z + camera[2], camera[3] * y / z + camera[4]
        inside += (0.0 <= u < size[0]) and (0.0 <= v < size[1])
    return 2 * inside > known
