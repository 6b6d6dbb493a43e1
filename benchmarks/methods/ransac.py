"""Plain baseline: people joined over views by the Hungarian method, then RANSAC for every joint.

No paper: this is what is written first for several calibrated cameras. Views are taken one after the other, that with
the most detections first. The detections of a view are assigned to the people so far by the mean distance of viewing
rays (Kuhn, "The Hungarian method for the assignment problem", 1955), and those that are too far from all start new
people. A joint is then triangulated from every pair of its views, the pair with the most inliers wins (Fischler &
Bolles, "Random sample consensus", 1981; with few views all samples are tried), and its inliers give the joint.

The result depends on the order of views where two have equally many detections.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.methods.points import estimate_of, nearest_point, pixel_error, ray_distance
from mvpose import Detections, Estimate, Rig
from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import Rays, viewing_rays

FARTHEST = 0.2
"""Mean distance of the rays of two detections of one person, at most, metres: the best of 0.07, 0.1, 0.15 and 0.2 on
the held-out scenes."""

SHARED = 3
"""Joints that two detections must both have to be compared."""

INLIER = 15.0
"""Residual of an inlier, at most, pixels: the default of Pose2Sim (``reproj_error_threshold_triangulation``)."""


class Ransac:
    """Hungarian association over views, and RANSAC for every joint."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame."""
        rays = viewing_rays(rig, detections)
        labels = associate(rays, len(rig))
        joints, scores = triangulate(rays, labels, INLIER)
        return estimate_of(joints, scores, labels, detections.skeleton)


estimator = Ransac()


def associate(rays: Rays, views: int) -> Integers:
    """Return the person of each detection, (m,), from 0; people of one view have a number as well."""
    labels = np.full(len(rays), -1)
    distance = mean_distances(rays.origins, rays.directions, rays.weights, SHARED)
    members = [np.flatnonzero(rays.view == view) for view in range(views)]
    people = 0
    for here in sorted(members, key=lambda each: -len(each)):
        free = here[(rays.weights[here] > 0).any(axis=1)]
        if not len(free):
            continue
        costs = np.full((len(free), people), np.inf)
        for person in range(people):
            known = distance[np.ix_(free, np.flatnonzero(labels == person))]
            shared = np.isfinite(known)
            sums = np.where(shared, known, 0.0).sum(axis=1)
            costs[:, person] = np.where(shared.any(axis=1), sums / np.maximum(shared.sum(axis=1), 1), np.inf)
        allowed = costs <= FARTHEST
        rows, columns = linear_sum_assignment(np.where(allowed, costs, 10 * FARTHEST))
        for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
            if allowed[row, column]:
                labels[free[row]] = column
        for detection in free:
            if labels[detection] < 0:
                labels[detection] = people
                people += 1
    return labels


def triangulate(rays: Rays, labels: Integers, inlier: float) -> tuple[Floats, Floats]:
    """Return the joints (n, J, 3), metres, and their scores (n, J) of all people, by RANSAC.

    Args:
        rays: viewing rays of m detections.
        labels: person of each, from 0, or -1, (m,).
        inlier: residual of an inlier, at most, pixels.
    """
    return _triangulate(rays.origins, rays.directions, rays.weights, rays.pixel, labels, inlier)


@njit(cache=True)
def mean_distances(origins: Floats, directions: Floats, weights: Floats, shared: int) -> Floats:
    """Return the mean distances of the rays of detections, weighted by scores, (m, m), metres; infinite without."""
    m, joints = weights.shape
    result = np.full((m, m), np.inf)
    for i in range(m):
        for j in range(i):
            total, weight, count = 0.0, 0.0, 0
            for k in range(joints):
                if weights[i, k] > 0.0 and weights[j, k] > 0.0:
                    share = np.sqrt(weights[i, k] * weights[j, k])
                    total += share * ray_distance(origins[i], directions[i, k], origins[j], directions[j, k])
                    weight += share
                    count += 1
            if count >= shared:
                result[i, j] = result[j, i] = total / weight
    return result


@njit(cache=True)
def _triangulate(
    origins: Floats, directions: Floats, weights: Floats, pixel: Floats, labels: Integers, inlier: float
) -> tuple[Floats, Floats]:
    people, joints = labels.max() + 1 if len(labels) else 0, weights.shape[1]
    result, scores = np.full((people, joints, 3), np.nan), np.zeros((people, joints))
    point = np.empty(3)
    for person in range(people):
        members = np.flatnonzero(labels == person)
        for j in range(joints):
            seen = members[weights[members, j] > 0.0]
            n = len(seen)
            best, best_error = np.zeros(n, np.bool_), np.inf
            for one in range(n):
                for two in range(one):
                    pair = seen[np.array([one, two])]
                    if not nearest_point(origins[pair], directions[pair, j], np.ones(2), point):
                        continue
                    inside, total = np.zeros(n, np.bool_), 0.0
                    for k in range(n):
                        error = pixel_error(origins[seen[k]], directions[seen[k], j], pixel[seen[k]], point)
                        inside[k] = error <= inlier
                        total += min(error, inlier)
                    if inside[one] and inside[two] and total < best_error:  # few outliers, and small residuals
                        best, best_error = inside, total
            chosen = seen[best]
            if len(chosen) >= 2 and nearest_point(origins[chosen], directions[chosen, j], weights[chosen, j], point):
                result[person, j] = point
                scores[person, j] = weights[chosen, j].mean()
    return result, scores
