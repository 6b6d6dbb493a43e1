"""The likelihood of the paper's section 3.3 as it stands there: heat maps, sampled where a point projects.

The Gaussians of :mod:`mvpose.reconstruction.likelihood` about the modes of the maps propose and refine; which proposal
is the likeliest, the maps decide.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mvpose.heatmaps import height
from mvpose.lens import distort
from mvpose.reconstruction.proposals import insert


@njit(cache=True)
def rescore(states, unary, count, labels, person, weights, maps, floor):
    """Score proposals by heat maps, in place, and sort them again, the likeliest first.

    A view says ``floor + height`` of its map at the projection, sub-pixel; the floor models a joint that it missed.

    Args:
        states: (J, S, 3), metres.
        unary: where to write, (J, S).
        count: how many of the S are valid, (J,).
        labels: whose each detection is, (m,).
        person: whose proposals these are.
        weights: heights of the modes of the person's n detections, (J, n, K).
        maps: values (m, J, h, w), grid (m, 4) and cameras (m, 22) of :class:`mvpose.rays.Modes`.
        floor: likelihood of a joint anywhere.
    """
    values, grid, cameras = maps
    for j in range(len(count)):
        for s in range(count[j]):
            x, y, z = states[j, s, 0], states[j, s, 1], states[j, s, 2]
            total, v = 0.0, 0
            for d in range(len(labels)):
                if labels[d] == person:
                    if weights[j, v, 0] > 0.0:
                        total += np.log(floor + _look_up(x, y, z, d, j, values, grid[d], cameras[d]))
                    v += 1
            insert(states[j], unary[j], s, total, x, y, z)


@njit(cache=True)
def _look_up(x, y, z, detection, joint, values, grid, camera):
    """Height of one map where a point of the world projects; 0 behind the camera."""
    x, y, z = x - camera[14], y - camera[15], z - camera[16]
    depth = camera[11] * x + camera[12] * y + camera[13] * z
    if depth <= 0.0:
        return 0.0
    across = (camera[5] * x + camera[6] * y + camera[7] * z) / depth
    down = (camera[8] * x + camera[9] * y + camera[10] * z) / depth
    u, v = distort(across, down, camera[17:22])
    column = camera[0] * u + camera[1] * v + camera[2]
    row = camera[3] * v + camera[4]
    return height(values, detection, joint, (column - grid[0]) / grid[2], (row - grid[1]) / grid[3])
