"""Rolling shutter: viewing rays of people who move, as if all rows of a picture were exposed at once.

A camera with a rolling shutter shows every joint at the time of its row. How far the joint moves between this time and
that of the picture follows from the velocity of its track, and the ray is turned by as much at the depth of the joint.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Rig
from mvpose.kernels import njit


def readouts(rig: Rig) -> Floats | None:
    """Return seconds from the first to the last row, and the rows, of each camera, (V, 2); None without any readout."""
    if not any(camera.readout for camera in rig):
        return None
    return np.array([(camera.readout, camera.size[1]) for camera in rig], float)


@njit(cache=True)
def undo_rolling(readout, view, keypoints, origins, directions, weights, labels, groups, state):
    """Return viewing rays (m, J, 3) of the joints at the times of the pictures, those of their middle rows.

    Detections without a track, and joints that are not known, keep their rays.

    Args:
        readout: of :func:`readouts`, (V, 2).
        view: camera of each detection, (m,).
        keypoints: pixels, (m, J, 2).
        origins: as in :class:`mvpose.rays.Rays`, and so ``directions`` and ``weights``.
        directions: the same.
        weights: the same.
        labels: group of each detection, (m,), or -1.
        groups: group of each track, (n,), or -1.
        state: predicted positions and velocities, (n, J, 6).
    """
    result, point = directions.copy(), np.empty(3)
    for d in range(len(view)):
        track = -1
        for t in range(len(groups)):
            if labels[d] >= 0 and groups[t] == labels[d]:
                track = t
        if track < 0 or readout[view[d], 0] == 0.0:
            continue
        for j in range(weights.shape[1]):
            if not weights[d, j] > 0.0 or np.isnan(state[track, j, 0]):
                continue
            late = readout[view[d], 0] * ((keypoints[d, j, 1] + 0.5) / readout[view[d], 1] - 0.5)
            depth, square = 0.0, 0.0
            for r in range(3):
                depth += (state[track, j, r] - origins[d, r]) * directions[d, j, r]
            if not depth > 0.0:
                continue
            for r in range(3):
                point[r] = depth * directions[d, j, r] - late * state[track, j, 3 + r]
                square += point[r] * point[r]
            if square > 0.0:
                for r in range(3):
                    result[d, j, r] = point[r] / np.sqrt(square)
    return result
