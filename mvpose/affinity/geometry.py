"""Affinity from the distance between viewing rays in metres, the default geometric cue.

It uses the same evidence as the epipolar distance of the paper (:mod:`mvpose.affinity.epipolar`), but its scale does
not change with resolution, focal length or the distance of the people, so one threshold serves every rig.
"""

import math
from dataclasses import dataclass

import numpy as np

from mvpose.affinity.base import FASTMATH, Floats, group_by_view, pack_poses, scalar_sigmoid, shared_joints
from mvpose.arrays import Integers
from mvpose.camera import Rig
from mvpose.checks import check_numbers
from mvpose.detections import Detections
from mvpose.kernels import njit
from mvpose.rays import Rays

_QUANTILE = 0.35  # more than a third of the mutual nearest pairs show one person, even with phantoms
_LEAST_PAIRS = 12  # mutual nearest pairs, below which a frame has too little information
_EXPLAINED = 0.05  # metres; value of that quantile from keypoint errors of 0.06 m (OKS) alone
_PARALLEL = 1e-9  # squared sine; rays this close to parallel diverge by 0.3 mm over 10 m


@dataclass(frozen=True)
class GeometricAffinity:
    """Affinity from the mean distance between the viewing rays of corresponding joints of two poses.

    Raises:
        ValueError: ``midpoint``, ``slope``, ``threshold`` or ``saturation`` not above 0, ``nearest`` below 0,
            ``widest`` below 1.
    """

    midpoint: float = 0.15
    """Distance at affinity 1/2, metres. Keypoints have a standard deviation of about 0.06 m across the ray (OKS sigmas
    of the limbs on an adult), so rays of one joint pass each other at 0.07 m on average. Two people who do not touch
    differ by 0.3 m or more unless they share an epipolar plane."""
    slope: float = 0.04
    """Distance over which the affinity falls from 1/2 to 1/(1 + e), metres."""
    threshold: float = 0.25
    """``th`` of the paper: distance beyond which the affinity is 0, metres."""
    saturation: float = 0.5
    """Greatest distance that one joint contributes, metres, so that one wrong limb cannot separate two otherwise equal
    poses."""
    least_joints: int = 3
    """Least number of shared detected joints; the affinity of poses that share fewer is 0."""
    nearest: float = 0.5
    """Start of a viewing ray, metres from the optical centre; a nearer body does not fit in the picture. Without it,
    all rays of two cameras side by side would pass each other closely in front of the lenses, whichever person they
    show."""
    widest: float = 2.0
    """Greatest factor by which midpoint, slope and threshold grow together in a frame where all rays meet badly because
    the calibration or the clocks are off. The factor is the ratio of ``misfit`` to the value that keypoint errors
    explain, at least 1; ``widest=1`` turns this off. Beyond 2, two people who do not touch would match."""

    def __post_init__(self) -> None:
        check_numbers(
            self,
            "the geometric affinity",
            positive=("midpoint", "slope"),
            limits=("threshold", "saturation"),
            not_negative=("nearest",),
        )
        if not 1.0 <= self.widest < math.inf:
            raise ValueError(f"widest of the geometric affinity must be at least 1 and finite, got {self.widest}")

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Return the affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`."""
        distance, _ = _compare_rays(
            rays.view, rays.origins, rays.directions, rays.weights, self.nearest, self.saturation,
            self.widest * self.threshold, max(self.least_joints, 1), False,
        )  # fmt: skip
        _to_affinity(distance, rays.view, self.midpoint, self.slope, self.threshold, self.widest)
        return distance


def ray_distance(rays: Rays, *, saturation: float = np.inf, nearest: float = 0.0) -> tuple[Floats, Integers]:
    """Return the mean distance between viewing rays of corresponding joints, weighted by both scores.

    Rays start ``nearest`` in front of the camera; where the lines meet behind that point, the distance is taken from
    there. The distance of parallel rays is that of their lines. Missing joints are left out.

    Args:
        rays: m detections; those of one view share its optical centre.
        saturation: greatest distance that one joint contributes, metres.
        nearest: start of a ray, metres from the optical centre.

    Returns:
        Distances, (m, m), metres, infinite for two poses of one view or without a common joint; and the number of
        joints that both poses have, (m, m), 0 for two poses of one view.
    """
    distance, shared = _compare_rays(
        rays.view, rays.origins, rays.directions, rays.weights, nearest, saturation, np.inf, 1, True
    )
    return distance, shared


@njit(cache=True)
def misfit(view, distance):
    """Return the typical ray distance between detections of one person, metres; 0 if there are too few pairs.

    Mutual nearest neighbours in two views are taken as detections of one person. Some of them are phantoms, which are
    far from each other, so the result is a lower quantile.

    Args:
        view: camera of each detection, (m,).
        distance: distances between detections, (m, m), metres; infinite where they are not compared.
    """
    m, (order, start) = len(view), group_by_view(view)
    distances, count = np.empty(m * len(start)), 0
    near, row_least, column_least = np.empty(m, np.int64), np.empty(m), np.empty(m)
    for p in range(len(start) - 2):
        for q in range(p + 1, len(start) - 1):
            for b in range(start[q], start[q + 1]):
                column_least[b] = np.inf
            for a in range(start[p], start[p + 1]):
                i, nearest, least = order[a], start[q], np.inf
                for b in range(start[q], start[q + 1]):  # no branches, because half of them would be mispredicted
                    value = distance[i, order[b]]
                    column_least[b] = value if value < column_least[b] else column_least[b]
                    nearest = b if value < least else nearest
                    least = value if value < least else least
                near[a], row_least[a] = nearest, least
            for a in range(start[p], start[p + 1]):
                if column_least[near[a]] == row_least[a] < np.inf:
                    distances[count] = row_least[a]
                    count += 1
    for n in range(1, count):  # insertion sort: that of NumPy takes seconds to compile
        value, place = distances[n], n
        while place > 0 and distances[place - 1] > value:
            distances[place] = distances[place - 1]
            place -= 1
        distances[place] = value
    return distances[int(_QUANTILE * count)] if count >= _LEAST_PAIRS else 0.0


@njit(cache=True)
def _to_affinity(distance, view, midpoint, slope, threshold, widest):
    """Replace distances by affinities, in place, at the scale of the frame."""
    factor = min(max(misfit(view, distance) / _EXPLAINED, 1.0), widest) if widest > 1.0 else 1.0
    midpoint, slope, threshold = factor * midpoint, factor * slope, factor * threshold
    m = len(distance)
    for i in range(m):
        distance[i, i] = 0.0
        for k in range(i + 1, m):
            d = distance[i, k]
            distance[i, k] = distance[k, i] = scalar_sigmoid(d, midpoint, slope) if d <= threshold else 0.0


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _compare_rays(view, origins, directions, weights, nearest, saturation, reach, least, counted):
    """Return mean distances, infinite beyond ``reach``, and, if ``counted``, the numbers of shared joints."""
    order, start = group_by_view(view)
    pose = pack_poses(directions, weights, order, 4)
    m, _, padded = pose.shape
    result = np.full((m, m), np.inf)
    shared = np.zeros((m, m) if counted else (0, 0), np.int64)
    level = min(reach, 1.0)  # any finite number serves if ``reach`` is infinite
    normal, first, second = np.empty((3, padded)), np.empty(padded), np.empty((m, padded))
    excess = np.empty(m)
    for p in range(len(start) - 2):
        for q in range(p + 1, len(start) - 1):
            # All pairs of two views share the baseline w: terms of the baseline and one ray are computed once.
            o, r = order[start[p]], order[start[q]]
            wx, wy, wz = origins[o, 0] - origins[r, 0], origins[o, 1] - origins[r, 1], origins[o, 2] - origins[r, 2]
            baseline2 = wx * wx + wy * wy + wz * wz
            for b in range(start[q], start[q + 1]):
                for j in range(padded):
                    second[b, j] = wx * pose[b, 0, j] + wy * pose[b, 1, j] + wz * pose[b, 2, j]
            for a in range(start[p], start[p + 1]):
                ux, uy, uz, weight_a = pose[a, 0], pose[a, 1], pose[a, 2], pose[a, 3]
                nx, ny, nz = normal[0], normal[1], normal[2]
                for j in range(padded):
                    nx[j] = wy * uz[j] - wz * uy[j]
                    ny[j] = wz * ux[j] - wx * uz[j]
                    nz[j] = wx * uy[j] - wy * ux[j]
                    first[j] = -(wx * ux[j] + wy * uy[j] + wz * uz[j])
                for b in range(start[q], start[q + 1]):
                    vx, vy, vz, weight_b, along_b = pose[b, 0], pose[b, 1], pose[b, 2], pose[b, 3], second[b]
                    total = 0.0
                    for j in range(padded):  # no branches, so that it vectorises over joints
                        cosine = ux[j] * vx[j] + uy[j] * vy[j] + uz[j] * vz[j]
                        volume = nx[j] * vx[j] + ny[j] * vy[j] + nz[j] * vz[j]  # w . (u x v)
                        sine2 = 1.0 - cosine * cosine
                        # Minimise |w' + s u - t v|^2 over s, t >= 0 along the rays from their starts: the minimum is
                        # interior if the lines meet ahead of both starts, else at s = 0 or t = 0.
                        shift = nearest * (1.0 - cosine)
                        s, t = first[j] - shift, along_b[j] - shift
                        ahead = min(s + t * cosine, t + s * cosine)
                        lines = volume * volume / max(sine2, _PARALLEL)
                        edge = max(s, t, 0.0)
                        starts = baseline2 - 2.0 * nearest * (s + t + shift)
                        square = lines if (ahead >= 0.0) & (sine2 > _PARALLEL) else max(starts - edge * edge, 0.0)
                        total += weight_a[j] * weight_b[j] * (min(math.sqrt(square), saturation) - level)
                    excess[b] = total
                for b in range(start[q], start[q + 1]):
                    if excess[b] > 0.0 and level == reach:  # the mean distance exceeds ``reach``
                        continue
                    mass, count = shared_joints(weight_a, pose[b, 3])
                    if count < least:
                        continue
                    i, k = order[a], order[b]
                    result[i, k] = result[k, i] = level + excess[b] / mass
                    if counted:
                        shared[i, k] = shared[k, i] = count
    return result, shared
