"""How likely two detections of different views are one person (paper, section 3.2, "Affinity matrix").

The paper measures the symmetric epipolar distance in pixels (:func:`epipolar_distance`). The default here is the
distance between viewing rays in metres (:func:`ray_distance`): it is the same evidence, but its scale does not
change with resolution, focal length or the distance of the people, so one threshold serves every rig.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.rays import Rays

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class GeometricAffinity:
    """Affinity from the mean distance between the viewing rays of two poses' joints.

    Attributes:
        midpoint: distance in metres at which a match is as likely as not (affinity 1/2). Keypoints scatter by
            about 0.06 m across the ray (OKS sigmas of the limbs on an adult), so rays of one joint pass each
            other at 0.07 m on average; two people who do not touch differ by 0.3 m and more unless they share
            an epipolar plane.
        slope: metres over which the affinity falls from 1/2 to 1/(1 + e).
        threshold: the paper's ``th``: the affinity is 0 beyond this distance, metres.
        saturation: a joint counts at most this far apart, metres, so that one wrong limb cannot part two
            otherwise equal poses.
        least_joints: poses that share fewer detected joints than this are not compared; their affinity is 0.
    """

    midpoint: float = 0.15
    slope: float = 0.04
    threshold: float = 0.25
    saturation: float = 0.5
    least_joints: int = 3

    def __call__(self, rays: Rays) -> Floats:
        """Affinity matrix, (m, m), 0 to 1, symmetric; 0 for two detections of one view, also on the diagonal."""
        distance, shared = ray_distance(rays, saturation=self.saturation)
        affinity = sigmoid(distance, midpoint=self.midpoint, slope=self.slope)
        affinity[(distance > self.threshold) | (shared < self.least_joints)] = 0.0
        return affinity


def sigmoid(distance: Floats, *, midpoint: float, slope: float) -> Floats:
    """Map distances to affinities in (0, 1), 1/2 at ``midpoint``, falling; 0 for an infinite distance."""
    return 1.0 / (1.0 + np.exp(np.clip((distance - midpoint) / slope, -700.0, 700.0))) * np.isfinite(distance)


def ray_distance(rays: Rays, *, saturation: float = np.inf) -> tuple[Floats, NDArray[np.int64]]:
    """Mean distance between the viewing rays of corresponding joints, weighted by both scores.

    Rays start at the camera: where the lines meet behind it, the distance is taken from the optical centre. The
    distance of parallel rays is the distance of their lines. Missing joints are left out.

    Args:
        rays: m poses.
        saturation: greatest distance that one joint can add, metres.

    Returns:
        Distances, (m, m), metres, infinite for two poses of one view or without a common joint; and the number
        of joints that both poses have, (m, m), 0 for two poses of one view.
    """
    return _ray_distance(rays.view, rays.origins, rays.directions, rays.weights, saturation)


@njit(cache=True)
def _ray_distance(view, origins, directions, weights, saturation):  # type: ignore[no-untyped-def]
    m, joints = weights.shape
    distance = np.full((m, m), np.inf)
    shared = np.zeros((m, m), np.int64)
    for a in range(m):
        for b in range(a + 1, m):
            if view[a] == view[b]:
                continue
            wx, wy = origins[a, 0] - origins[b, 0], origins[a, 1] - origins[b, 1]
            wz = origins[a, 2] - origins[b, 2]
            total, mass, count = 0.0, 0.0, 0
            for j in range(joints):
                weight = weights[a, j] * weights[b, j]
                if weight <= 0.0:
                    continue
                ux, uy, uz = directions[a, j, 0], directions[a, j, 1], directions[a, j, 2]
                vx, vy, vz = directions[b, j, 0], directions[b, j, 1], directions[b, j, 2]
                cosine = ux * vx + uy * vy + uz * vz
                along_a = -(wx * ux + wy * uy + wz * uz)
                along_b = wx * vx + wy * vy + wz * vz
                sine2 = 1.0 - cosine * cosine
                # Closest points of two half-lines: solve for the lines, then clamp each parameter and re-solve
                # the other. (Nearly) parallel rays take the point beside the second origin.
                s = (along_a + along_b * cosine) / sine2 if sine2 > 1e-12 else max(along_a, 0.0)
                s = max(s, 0.0)
                t = along_b + s * cosine
                if t < 0.0:
                    t = 0.0
                    s = max(along_a, 0.0)
                dx = wx + s * ux - t * vx
                dy = wy + s * uy - t * vy
                dz = wz + s * uz - t * vz
                total += weight * min(np.sqrt(dx * dx + dy * dy + dz * dz), saturation)
                mass += weight
                count += 1
            if count:
                distance[a, b] = distance[b, a] = total / mass
                shared[a, b] = shared[b, a] = count
    return distance, shared


def epipolar_distance(rig: Rig, detections: Detections) -> Floats:
    """The paper's D_g: symmetric point-to-epipolar-line distance averaged over joints, weighted by both scores.

    Args:
        rig: V cameras.
        detections: m poses.

    Returns:
        Distances, (m, m), pixels without lens distortion; infinite for two poses of one view or without a common
        joint.
    """
    m = len(detections)
    points = np.ones((m, len(detections.skeleton), 3))
    for index, camera in enumerate(rig):
        mine = detections.view == index
        points[mine, :, :2] = np.nan_to_num(camera.undistort(detections.keypoints[mine]))
    # lines[a, b, j]: epipolar line in the view of b of joint j of pose a
    lines = np.einsum("abrc,ajc->abjr", rig.F[detections.view[:, None], detections.view[None, :]], points)
    norm = np.maximum(np.linalg.norm(lines[..., :2], axis=-1), 1e-300)
    one_way = np.abs(np.einsum("abjr,bjr->abj", lines, points)) / norm
    weight = detections.scores[:, None] * detections.scores[None, :]
    mass = weight.sum(axis=2)
    both = (0.5 * (one_way + one_way.transpose(1, 0, 2)) * weight).sum(axis=2) / np.where(mass > 0, mass, 1.0)
    same_view = detections.view[:, None] == detections.view[None, :]
    return np.where(same_view | (mass <= 0), np.inf, both)
