"""Likelihood from heat maps, sampled where a point projects (paper, section 3.3).

Proposals and refinement use Gaussians at the modes of the maps (:mod:`mvpose.reconstruction.likelihood`); the maps
themselves decide which proposal is the likeliest.
"""

from __future__ import annotations

import numpy as np

from mvpose.heatmaps import height
from mvpose.kernels import njit
from mvpose.lens import distort
from mvpose.reconstruction.proposals import insert


@njit(cache=True)
def rescore(states, unary, count, labels, person, weights, maps, floor):
    """Score proposals by heat maps, in place, and sort them again, the likeliest first.

    The likelihood of a view is ``floor + height`` of its map at the projection (sub-pixel); the floor models a joint
    that the detector missed.

    Args:
        states: proposals, (J, S, 3), metres.
        unary: output, log-likelihood of each proposal, (J, S).
        count: number of valid proposals per joint, (J,).
        labels: person of each detection, (m,).
        person: label of the person to whom the proposals belong.
        weights: heights of the modes of the person's n detections, (J, n, K).
        maps: values (M, J, h, w), row (m,), grid (m, 4) and cameras (m, 22) of :class:`mvpose.rays.Modes`.
        floor: likelihood of a joint at any place.
    """
    values, row, grid, cameras = maps
    for j in range(len(count)):
        for s in range(count[j]):
            x, y, z = states[j, s, 0], states[j, s, 1], states[j, s, 2]
            total, v = 0.0, 0
            for d in range(len(labels)):
                if labels[d] == person:
                    if weights[j, v, 0] > 0.0:
                        total += np.log(floor + _height_at(x, y, z, row[d], j, values, grid[d], cameras[d]))
                    v += 1
            insert(states[j], unary[j], s, total, x, y, z)


@njit(cache=True)
def _height_at(x, y, z, detection, joint, values, grid, camera):
    """Return the height of one map where a world point projects; 0 behind the camera."""
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
