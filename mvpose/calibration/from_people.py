"""Extrinsics of a rig from nothing but lenses and people: the people are the board.

The poses of pairs of cameras (:mod:`.view_pairs`) are edges of a graph. Its spanning tree of greatest evidence puts all
cameras into one world; rotations and then centres are averaged over all edges that agree with it (robustly: Hartley et
al., "Rotation Averaging", IJCV 2013). From there the rig is one that is believed to some degrees, which the repair
(:mod:`.repair`) matches over seconds and adjusts, until it stays as it is. The people also give what pictures do not
show: their stature the unit, their feet the floor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial.transform import Rotation

from mvpose.arrays import Bools, Floats
from mvpose.calibration.calibration_prior import Prior
from mvpose.calibration.consistency import Consistency
from mvpose.calibration.floor import level
from mvpose.calibration.pieces import cut_into_windows
from mvpose.calibration.repair import Repair, repair
from mvpose.calibration.sufficiency import RECORD
from mvpose.calibration.tracklets import link
from mvpose.calibration.view_pairs import RelativePose, relative_poses
from mvpose.camera import Rig
from mvpose.detections import Detections

_FAR = np.radians(15.0)  # of an edge from the average, beyond which it is wrong
_LEAST_AGREEMENT = 0.7  # of a pair; see mvpose.calibration.sufficiency
_ROUNDS = 50
_PRIOR = Prior(float(np.radians(2.0)), 0.2)  # of what averaging leaves
_MOST_TURNS = 4
_STAYS = (float(np.radians(0.02)), 0.002)  # rad, m: changes of a repair that is at its end


def averaged(edges: Sequence[RelativePose], views: int) -> tuple[Floats, Floats, Bools]:
    """Return rotations (V, 3, 3) and centres (V, 3) of cameras in the world of the first one of the largest part.

    Returns:
        Poses, and the cameras that have one, (V,).
    """
    weights = np.zeros((views, views))
    of_pair = {each.views: each for each in edges}
    for each in edges:
        weights[each.views] = -each.evidence
    tree = minimum_spanning_tree(weights)
    degree = -(weights + weights.T).sum(axis=1)
    order, before = breadth_first_order(tree, int(degree.argmax()), directed=False)
    R, centers, known = np.tile(np.eye(3), (views, 1, 1)), np.zeros((views, 3)), np.zeros(views, np.bool_)
    known[order[0]] = True
    for view in order[1:]:
        parent = before[view]
        pose, known[view] = of_pair[min(view, parent), max(view, parent)], True
        turn, shift = (pose.R, pose.t) if parent < view else (pose.R.T, -pose.R.T @ pose.t)
        R[view] = turn @ R[parent]
        centers[view] = centers[parent] - R[view].T @ shift
    within = [each for each in edges if known[each.views[0]] and known[each.views[1]]]
    R = _average_rotations(within, R)
    near = [each for each in within if _off(each, R) < _FAR]
    return R, _average_centers(near, R, centers), known


def _off(edge: RelativePose, R: Floats) -> float:
    """Return the angle between the rotation of an edge and that between two cameras."""
    i, j = edge.views
    return float(np.linalg.norm(Rotation.from_matrix(edge.R.T @ R[j] @ R[i].T).as_rotvec()))


def _average_rotations(edges: Sequence[RelativePose], R: Floats) -> Floats:
    """Return rotations of least weighted sum of angles to those of the edges (Weiszfeld's algorithm)."""
    for _ in range(_ROUNDS):
        before = R.copy()
        for view in range(len(R)):
            wanted, weights = [], []
            for each in edges:
                i, j = each.views
                if view in (i, j):
                    wanted.append(each.R.T @ R[j] if view == i else each.R @ R[i])
                    weights.append(each.points**0.5 / max(_off(each, R), 1e-3))
            if wanted:
                R[view] = Rotation.from_matrix(np.array(wanted)).mean(weights).as_matrix()
        if np.abs(R - before).max() < 1e-5:
            break
    return R


def _average_centers(edges: Sequence[RelativePose], R: Floats, centers: Floats) -> Floats:
    """Return centres of least weighted sum of distances from those that the edges say."""
    for _ in range(_ROUNDS):
        before = centers.copy()
        for view in range(len(R)):
            wanted, weights = [], []
            for each in edges:
                i, j = each.views
                if view in (i, j):
                    along = -R[j].T @ each.t  # from the first centre to the second
                    wanted.append(centers[j] - along if view == i else centers[i] + along)
                    weights.append(each.points**0.5 / max(float(np.linalg.norm(wanted[-1] - centers[view])), 1e-3))
            if wanted:
                centers[view] = np.average(wanted, axis=0, weights=weights)
        if np.abs(centers - before).max() < 1e-5:
            break
    return centers
