"""Heat maps of keypoints fused in a voxel grid, without learning: written again from VoxelKeypointFusion.

Bermuth, Poeppel & Reif, "VoxelKeypointFusion: Generalizable Multi-View Multi-Person Pose Estimation", arXiv 2410.18723,
2024. Its idea: the heat maps of each kind of joint are projected into one voxel grid and averaged over the views that
see a voxel, as in VoxelPose (Tu, Wang & Zeng, ECCV 2020) but with no network behind them; peaks of the grid are joints;
the 2D people that a joint projects onto say to whom it belongs. So a keypoint may take part in several joints, and no
detection has to be matched as a whole.

The volume is the same, and visited sparsely: a peak that two views support lies near a crossing of two rays, so from
each crossing the peak is climbed to, by mean shift, and its place does not depend on a grid. Heat maps are Gaussians at
the keypoints, as high as their scores and as wide as those that VoxelPose trains with. Left out: depth pictures, which
the paper may use to mask voxels, limits of the room, and heat maps of a network with several modes. The thresholds of
peaks are this file's own, from the geometry of a crossing; the paper's were not at hand.
"""

from __future__ import annotations

import numpy as np

from benchmarks.methods.points import estimate_of, nearest_point, pixel_error, ray_distance
from mvpose import Detections, Estimate, Rig
from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import viewing_rays

FINEST = 0.0005
"""Step at which the way to a peak ends, metres."""

MOST_STEPS = 30
"""Steps to a peak, at most."""

FADED = 4.0
"""Deviations from its keypoint at which a heat map has faded."""

WIDTH = 12.0 / 960.0
"""Standard deviation of a heat map as a share of the width of the picture: 3 pixels of maps of a quarter of the size,
of pictures 960 pixels wide, in VoxelPose."""

SUPPORT = 0.1
"""Least value of a heat map, relative to the score of its keypoint, that supports a peak: two deviations away."""

SAME = 0.1
"""Distance below which two peaks of one joint are one, metres: a voxel of the coarse grid of VoxelPose."""

COMMON = 3
"""Joints that the 2D poses of two views must support together to be one person's."""


class VoxelFusion:
    """Peaks of fused heat maps, grouped by the 2D poses that support them."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame."""
        joint, places, heights, supports = peaks(rig, detections)
        labels = _people(detections.view, joint, heights, supports)
        count = int(labels.max(initial=-1)) + 1
        joints = np.full((count, len(detections.skeleton), 3), np.nan)
        scores = np.zeros(joints.shape[:2])
        for person in range(count):
            members = labels == person
            own = np.where(members[None, :], supports, 0.0)
            value = own.sum(axis=1) * ((own > 0.0).sum(axis=1) >= 2)
            for j in range(len(detections.skeleton)):
                mine = np.flatnonzero((joint == j) & (value > 0.0))
                if len(mine):
                    best = mine[value[mine].argmax()]
                    joints[person, j], scores[person, j] = places[best], heights[best]
        return estimate_of(joints, scores, labels, detections.skeleton)


estimator = VoxelFusion()


def peaks(rig: Rig, detections: Detections) -> tuple[Integers, Floats, Floats, Floats]:
    """Return the peaks of the volume: joint (k,), place (k, 3), height (k,), and support by each detection (k, m)."""
    rays = viewing_rays(rig, detections)
    widths = np.array([WIDTH * camera.size[0] for camera in rig])[rays.view] * rays.pixel
    inside = np.array([[*camera.R[2], camera.t[2], _field(camera.K, camera.size)] for camera in rig])
    return _peaks(rays.view, rays.origins, rays.directions, rays.weights, widths, rig.centers, inside)


def _field(K: Floats, size: tuple[int, int]) -> float:
    """Return the cosine of the widest angle between the optical axis and a ray inside the picture."""
    corner = np.hypot(max(K[0, 2], size[0] - K[0, 2]) / K[0, 0], max(K[1, 2], size[1] - K[1, 2]) / K[1, 1])
    return float(1.0 / np.sqrt(1.0 + corner**2))


@njit(cache=True)
def _climb(
    point: Floats,
    j: int,
    view: Integers,
    origins: Floats,
    directions: Floats,
    weights: Floats,
    widths: Floats,
    best: Floats,
    strongest: Integers,
) -> bool:
    """Move a point to the peak of the volume near it, by mean shift; return whether there is one.

    ``best`` and ``strongest`` (V,) receive the value of each view's heat map at the peak, and whose keypoint it is.
    """
    views = len(best)
    ends, rays, shares, moved = np.zeros((views, 3)), np.zeros((views, 3)), np.zeros(views), np.empty(3)
    for _ in range(MOST_STEPS):
        best[:], strongest[:], shares[:] = 0.0, -1, 0.0
        for d in range(len(view)):
            if weights[d, j] <= 0.0:
                continue
            off = pixel_error(origins[d], directions[d, j], widths[d], point)  # in standard deviations
            if off < FADED:
                value = weights[d, j] * np.exp(-0.5 * off * off)
                if value > best[view[d]]:
                    best[view[d]], strongest[view[d]] = value, d
        for v in range(views):
            if strongest[v] >= 0:
                ends[v], rays[v] = origins[strongest[v]], directions[strongest[v], j]
                shares[v] = best[v] / widths[strongest[v]] ** 2
        if not nearest_point(ends, rays, shares, moved):
            return False
        step = np.sqrt(((moved - point) ** 2).sum())
        point[:] = moved
        if step < FINEST or (best > 0.0).sum() == 2:  # two rays: the point between them
            return True
    return True


@njit(cache=True)
def _peaks(
    view: Integers,
    origins: Floats,
    directions: Floats,
    weights: Floats,
    widths: Floats,
    centers: Floats,
    inside: Floats,
) -> tuple[Integers, Floats, Floats, Floats]:
    """Return the peaks: joint (k,), place (k, 3), height over the views that see it (k,), and supports (k, m).

    Args:
        view: camera of each detection, (m,).
        origins: optical centres, (m, 3), metres.
        directions: viewing rays, (m, J, 3).
        weights: scores, (m, J).
        widths: standard deviation of heat maps, (m,), as an angle.
        centers: optical centres of the cameras, (V, 3).
        inside: optical axis (3), depth of the world's origin and cosine of the widest angle of each camera, (V, 5).
    """
    m, joints = weights.shape
    views = len(centers)
    joint, place = [0 for _ in range(0)], [np.zeros(3) for _ in range(0)]
    height, support = [0.0 for _ in range(0)], [np.zeros(m) for _ in range(0)]
    point, best, strongest = np.empty(3), np.zeros(views), np.zeros(views, np.int64)
    ends, rays, even = np.empty((2, 3)), np.empty((2, 3)), np.ones(2)
    for j in range(joints):
        for one in range(m):
            if weights[one, j] <= 0.0:
                continue
            for two in range(one):
                if weights[two, j] <= 0.0 or view[one] == view[two]:
                    continue
                ends[0], ends[1] = origins[one], origins[two]
                rays[0], rays[1] = directions[one, j], directions[two, j]
                if ray_distance(ends[0], rays[0], ends[1], rays[1]) > 1.0:
                    continue
                if not nearest_point(ends, rays, even, point):
                    continue
                off = max(
                    pixel_error(ends[0], rays[0], widths[one], point), pixel_error(ends[1], rays[1], widths[two], point)
                )
                if np.exp(-0.5 * off * off) < SUPPORT:
                    continue
                if not _climb(point, j, view, origins, directions, weights, widths, best, strongest):
                    continue
                seeing, supporting, mine = 0, 0, np.zeros(m)
                for v in range(views):
                    x, depth = point - centers[v], inside[v, 3]
                    for r in range(3):
                        depth += inside[v, r] * point[r]
                    seeing += depth > inside[v, 4] * np.sqrt((x * x).sum()) or best[v] > 0.0
                for v in range(views):
                    d = strongest[v]
                    if d >= 0 and best[v] >= SUPPORT * weights[d, j]:
                        mine[d] = best[v]
                        supporting += 1
                if supporting >= 2:
                    joint.append(j)
                    place.append(point.copy())
                    height.append(best.sum() / max(seeing, 1))
                    support.append(mine)
    kept = _highest(np.array(joint), place, np.array(height))
    places, supports = np.empty((len(kept), 3)), np.empty((len(kept), m))
    for row in range(len(kept)):
        places[row], supports[row] = place[kept[row]], support[kept[row]]
    return np.array(joint)[kept], places, np.array(height)[kept], supports


@njit(cache=True)
def _highest(joint: Integers, place: list[Floats], height: Floats) -> Integers:
    """Return the peaks that are not near a higher one of the same joint, (k,), the highest first."""
    kept, count = np.empty(len(joint), np.int64), 0
    for row in np.argsort(-height, kind="mergesort"):
        near = False
        for index in range(count):
            if joint[kept[index]] == joint[row]:
                near = near or np.sqrt(((place[kept[index]] - place[row]) ** 2).sum()) < SAME
        if not near:
            kept[count] = row
            count += 1
    return kept[:count]


def _people(view: Integers, joint: Integers, heights: Floats, supports: Floats) -> Integers:
    """Return the person of each detection, (m,), from 0; -1 for one that shares no joints with another view.

    Two poses belong together as far as they support the same peaks, of which each keypoint votes for the highest that
    it supports. Poses are joined in the order of that support, with one pose of a view in a person.
    """
    m = len(view)
    labels = np.arange(m)
    common, count = np.zeros((m, m)), np.zeros((m, m), np.int64)
    for j in np.unique(joint):
        rows = np.flatnonzero(joint == j)
        values = np.where(supports[rows] > 0.0, heights[rows, None], 0.0)  # (k, m)
        highest = np.where(values.max(axis=0) > 0.0, rows[values.argmax(axis=0)], -1)
        same = (highest[:, None] == highest) & (highest >= 0)
        common += np.where(same, heights[highest], 0.0)
        count += same
    common[(view[:, None] == view[None, :]) | (count < COMMON)] = 0.0
    rows, columns = np.nonzero(np.triu(common))
    for index in np.argsort(-common[rows, columns], kind="stable"):
        one, two = labels[rows[index]], labels[columns[index]]
        if one != two and not set(view[labels == one]) & set(view[labels == two]):
            labels[labels == two] = one
    sizes = np.bincount(labels, minlength=m)
    names = {group: number for number, group in enumerate(np.flatnonzero(sizes > 1).tolist())}
    return np.array([names.get(int(label), -1) for label in labels], np.int64)
