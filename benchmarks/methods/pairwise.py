"""Pairs of 2D poses triangulated and grouped in 3D: written again from RapidPoseTriangulation.

Bermuth, Poeppel & Reif, "RapidPoseTriangulation: Multi-view Multi-person Whole-body Human Pose Triangulation in a
Millisecond", arXiv 2503.21692, 2025. Its steps: every two poses of different views are a pair; the core joints of a
pair are triangulated, and projected into both views; pairs whose joints do not come back near to where they were are
left out; the poses that remain are grouped in 3D; all joints of these pairs are triangulated, and those of a group
merged, without outliers.

Left out: the choice of pairs by the people of the frame before (frames are estimated alone here), the limits of the
room, which the paper's configuration has and a rig alone does not say, and whole-body keypoints. Score and thresholds
are this file's own; they were not compared with the released code. This file adds that a 2D pose belongs to one group,
the one with the most pairs: without it, pairs of different people that happen to agree are people as well.
"""

from __future__ import annotations

import numpy as np

from benchmarks.methods.points import estimate_of, nearest_point, pixel_error
from mvpose import Detections, Estimate, Rig
from mvpose.arrays import Bools, Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import viewing_rays
from mvpose.skeleton import Skeleton

CORE = ("nose", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
"""Parts whose joints decide whether two poses are one person's."""

LEAST_SCORE = 0.9
"""Least score of a pair: the best of 0.85, 0.9, 0.93, 0.95 and 0.97 on the held-out scenes. The score of a joint is
1 / (1 + 10 e), with its residual e as a share of the picture, the mean of width and height."""

CLIPPED = 0.25
"""Largest residual of a joint, as a share of the picture."""

WORST = 0.2
"""Share of the joints of a pair that are left out of its score, the worst ones: detectors guess hidden joints."""

SHARED = 3
"""Core joints that two poses must both have to be compared."""

CENTRES = 0.6
"""Distance of the centres of two poses of a group, at most, metres."""

POSES = 0.3
"""Mean distance of the joints of two poses of a group, at most, metres."""

OUTLIER = 0.2
"""Distance of a joint of a pair from the median of its group from which it is left out, metres: the better of 0.1 and
0.2 on the held-out scenes."""


class PairwiseTriangulation:
    """Triangulation of all pairs of poses, and groups of them."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame."""
        rays = viewing_rays(rig, detections)
        sizes = np.array([np.mean(camera.size) for camera in rig])[rays.view]
        core = _core(detections.skeleton)
        pairs, scores, poses, weights = _pairs(
            rays.view, rays.origins, rays.directions, rays.weights, rays.pixel, sizes, core, LEAST_SCORE
        )
        groups = claimed(pairs, scores, _groups(poses, scores, core))
        count = int(groups.max(initial=-1)) + 1
        joints = np.full((count, len(detections.skeleton), 3), np.nan)
        certain = np.zeros(joints.shape[:2])
        for group in range(count):
            joints[group], certain[group] = merged(poses[groups == group], weights[groups == group])
        labels = _labels(pairs, scores, groups, rays.view)
        return estimate_of(joints, certain, labels, detections.skeleton)


estimator = PairwiseTriangulation()


def _core(skeleton: Skeleton) -> Bools:
    return np.array([part in CORE for part in skeleton.parts])


@njit(cache=True)
def _pairs(
    view: Integers,
    origins: Floats,
    directions: Floats,
    weights: Floats,
    pixel: Floats,
    sizes: Floats,
    core: Bools,
    least: float,
) -> tuple[Integers, Floats, Floats, Floats]:
    """Return the pairs of detections (k, 2) that agree, their scores (k,), poses (k, J, 3) and weights (k, J)."""
    m, joints = weights.shape
    most = m * m // 2 + 1
    pairs, scores = np.empty((most, 2), np.int64), np.empty(most)
    poses, shares = np.full((most, joints, 3), np.nan), np.zeros((most, joints))
    ends, rays, even, found = np.empty((2, 3)), np.empty((2, 3)), np.ones(2), 0
    for i in range(m):
        for j in range(i):
            if view[i] == view[j]:
                continue
            values, count = np.empty(joints), 0
            poses[found], shares[found] = np.nan, 0.0
            ends[0], ends[1] = origins[i], origins[j]
            for k in range(joints):
                if not (weights[i, k] > 0.0 and weights[j, k] > 0.0):
                    continue
                rays[0], rays[1] = directions[i, k], directions[j, k]
                if not nearest_point(ends, rays, even, poses[found, k]):
                    poses[found, k] = np.nan
                    continue
                error = 0.0
                for d in (i, j):
                    off = pixel_error(origins[d], directions[d, k], pixel[d], poses[found, k]) / sizes[d]
                    error += 0.5 * min(off, CLIPPED)
                score = 1.0 / (1.0 + 10.0 * error)
                shares[found, k] = score * np.sqrt(weights[i, k] * weights[j, k])
                if core[k]:
                    values[count] = score
                    count += 1
            if count < 4:
                continue
            best = np.sort(values[:count])[int(WORST * count) :]
            if best.mean() >= least:
                pairs[found, 0], pairs[found, 1], scores[found] = i, j, best.mean()
                found += 1
    return pairs[:found], scores[:found], poses[:found], shares[:found]


@njit(cache=True)
def _groups(poses: Floats, scores: Floats, core: Bools) -> Integers:
    """Return the group of each pose, (k,): that of the nearest group so far, the best poses first."""
    count, joints = len(poses), poses.shape[1]
    groups, found = np.full(count, -1), 0
    means, sizes = np.empty((count, joints, 3)), np.zeros((count, joints))
    for index in np.argsort(-scores, kind="mergesort"):
        nearest, best = -1, POSES
        for group in range(found):
            shared, apart, shift = 0, 0.0, np.zeros(3)
            for j in range(joints):
                if core[j] and sizes[group, j] > 0.0 and np.isfinite(poses[index, j, 0]):
                    off = poses[index, j] - means[group, j]
                    apart += np.sqrt((off * off).sum())
                    shift += off
                    shared += 1
            if shared < SHARED:
                continue
            if np.sqrt((shift * shift).sum()) / shared < CENTRES and apart / shared < best:
                nearest, best = group, apart / shared
        if nearest < 0:
            nearest = found
            found += 1
        groups[index] = nearest
        for j in range(joints):
            if np.isfinite(poses[index, j, 0]):
                if sizes[nearest, j] == 0.0:
                    means[nearest, j] = 0.0
                means[nearest, j] += (poses[index, j] - means[nearest, j]) / (sizes[nearest, j] + 1.0)
                sizes[nearest, j] += 1.0
    return groups


def claimed(pairs: Integers, scores: Floats, groups: Integers) -> Integers:
    """Return the groups (k,), with -1 for pairs with a detection that belongs to a group with a larger sum of scores.

    Groups are numbered anew, in the order of these sums.
    """
    sums = np.bincount(groups, weights=scores) if len(groups) else np.zeros(0)
    owners: dict[int, int] = {}
    result = np.full(len(groups), -1)
    for group in np.argsort(-sums, kind="stable").tolist():
        rows = [
            row for row in np.flatnonzero(groups == group) if not {int(each) for each in pairs[row]} & owners.keys()
        ]
        if rows:
            number = int(result.max()) + 1
            result[rows] = number
            owners.update(dict.fromkeys(pairs[rows].ravel().tolist(), number))
    return result


def merged(poses: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Return the joints (J, 3) and scores (J,) of a group of poses (k, J, 3), weights (k, J), without outliers."""
    joints = np.full(poses.shape[1:], np.nan)
    scores = np.zeros(len(joints))
    for j in range(len(joints)):
        known = np.isfinite(poses[:, j, 0])
        if not known.any():
            continue
        points, shares = poses[known, j], weights[known, j]
        near = np.linalg.norm(points - np.median(points, axis=0), axis=1) <= OUTLIER
        if not near.any():
            near = shares == shares.max()
        joints[j] = np.average(points[near], axis=0, weights=shares[near] + 1e-9)
        scores[j] = shares[near].mean()
    return joints, scores


def _labels(pairs: Integers, scores: Floats, groups: Integers, view: Integers) -> Integers:
    """Return the person of each detection, (m,): the group of its best pairs; one detection of a view in each."""
    m, count = len(view), int(groups.max(initial=-1)) + 1
    votes = np.zeros((m, count))
    for (i, j), score, group in zip(pairs, scores, groups, strict=True):
        if group >= 0:
            votes[i, group] += score
            votes[j, group] += score
    labels = np.full(m, -1)
    for flat in np.argsort(-votes, axis=None, kind="stable"):
        detection, group = divmod(int(flat), count)
        if votes[detection, group] <= 0.0:
            break
        if labels[detection] < 0 and not ((labels == group) & (view == view[detection])).any():
            labels[detection] = group
    return labels
