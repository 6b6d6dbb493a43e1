"""Affinity from the symmetric point-to-epipolar-line distance in pixels, the geometric cue of the paper."""

import math
from dataclasses import dataclass

import numpy as np

from mvpose.affinity.base import FASTMATH, Floats, group_by_view, pack_poses, scalar_sigmoid, shared_joints
from mvpose.camera import Rig
from mvpose.checks import check_numbers
from mvpose.detections import Detections
from mvpose.kernels import njit
from mvpose.rays import Rays, viewing_rays

_WIDTH = 1000.0  # image width in pixels to which distances are normalised
_FAR = 1e9  # pixels; beyond any image
_SAME_POINT = 1e-6  # metres; below the accuracy of any calibration


@dataclass(frozen=True)
class EpipolarAffinity:
    """Affinity from the distance D_g of the paper (section 3.2): symmetric distance of joints from epipolar lines.

    Distances are in pixels of an undistorted image 1000 pixels wide (pixels of the view times 1000 / its width), so
    one scale serves 360 x 288 and 4K. The images of the paper's experiments are about as wide.

    Unlike in the paper, a line ends where the ray ends: it is the image of the points that lie at least ``nearest`` in
    front of the other camera, and in front of this one. The distance of a joint beyond an end is measured to that end,
    and a joint whose ray this camera cannot see at all has distance ``saturation``. So poses do not match through
    lines that meet behind a camera. For two cameras at the same point the line is the vanishing point of the ray.

    Raises:
        ValueError: ``midpoint``, ``slope``, ``threshold`` or ``saturation`` not above 0, ``nearest`` or ``epipole``
            below 0.
    """

    midpoint: float = 26.0
    """Distance at affinity 1/2, pixels. A person typically fills 300 of the 1000 pixels; keypoints then have a standard
    deviation of 10 pixels in each axis (OKS sigmas of the limbs) and lie 12 pixels from their lines on average. These
    are the scales of :class:`mvpose.affinity.GeometricAffinity` at 175 pixels per metre."""
    slope: float = 7.0
    """Distance over which the affinity falls from 1/2 to 1/(1 + e), pixels."""
    threshold: float = 44.0
    """``th`` of the paper: distance beyond which the affinity is 0, pixels."""
    saturation: float = 88.0
    """Greatest distance that one joint contributes in each direction, pixels."""
    least_joints: int = 3
    """Least number of shared joints; the affinity of poses that share fewer is 0."""
    nearest: float = 0.5
    """Start of a viewing ray, metres from the optical centre."""
    epipole: float = 10.0
    """Distance from the epipole below which a joint is treated as missing, pixels. With the accuracy of keypoints its
    epipolar line has no defined direction there."""

    def __post_init__(self) -> None:
        check_numbers(
            self,
            "the epipolar affinity",
            positive=("midpoint", "slope"),
            limits=("threshold", "saturation"),
            not_negative=("nearest", "epipole"),
        )

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Return the affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`."""
        return _compare_lines(
            rays.view, rays.directions, rays.weights, rig.centers, _image(rig), self.nearest, self.epipole,
            (self.saturation, self.midpoint, self.slope, self.threshold), max(self.least_joints, 1), False,
        )  # fmt: skip


def epipolar_distance(rig: Rig, detections: Detections) -> Floats:
    """Return D_g of the paper: the symmetric point-to-epipolar-line distance, averaged with both scores as weights.

    Args:
        rig: V cameras.
        detections: m detections.

    Returns:
        Distances, (m, m), in pixels of an undistorted image 1000 pixels wide, with lines that end where the rays end
        (:class:`EpipolarAffinity`); infinite for two poses of one view or without a common joint off the epipoles.
    """
    rays = viewing_rays(rig, detections)
    return _compare_lines(
        rays.view, rays.directions, rays.weights, rig.centers, _image(rig), 0.0, 0.0, (np.inf, 0.0, 1.0, 0.0), 1, True
    )


def _image(rig: Rig) -> Floats:
    """Return matrices from world directions to homogeneous pixels of images 1000 pixels wide, (V, 3, 3)."""
    matrices = rig.P[:, :, :3].copy()
    matrices[:, :2] *= _WIDTH / np.array([camera.size[0] for camera in rig])[:, None, None]
    return matrices


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _compare_lines(view, directions, weights, centers, image, nearest, epipole, curve, least, distances):
    """Return affinities by a curve (saturation, midpoint, slope, threshold), or mean distances if they are wanted."""
    saturation, midpoint, slope, threshold = curve
    order, start = group_by_view(view)
    pose = pack_poses(directions, weights, order, 6)  # channels 4 and 5 are the pixel
    m, _, padded = pose.shape
    for i in range(m):
        camera = image[view[order[i]]]
        for j in range(padded):
            x, y, z = pose[i, 0, j], pose[i, 1, j], pose[i, 2, j]
            depth = camera[2, 0] * x + camera[2, 1] * y + camera[2, 2] * z
            if depth > 0.0:
                pose[i, 4, j] = (camera[0, 0] * x + camera[0, 1] * y + camera[0, 2] * z) / depth
                pose[i, 5, j] = (camera[1, 0] * x + camera[1, 1] * y + camera[1, 2] * z) / depth
            else:
                pose[i, 3, j] = 0.0
    result = np.full((m, m), np.inf) if distances else np.zeros((m, m))
    line_a, lines_b = np.zeros((6, padded)), np.zeros((m, 6, padded))
    excess = np.empty(m)
    for p in range(len(start) - 2):
        for q in range(p + 1, len(start) - 1):
            one, other = view[order[start[p]]], view[order[start[q]]]
            for b in range(start[q], start[q + 1]):
                _epipolar_lines(
                    lines_b[b], pose[b], image[other], image[one], centers[other], centers[one], nearest, epipole
                )
            for a in range(start[p], start[p + 1]):
                _epipolar_lines(
                    line_a, pose[a], image[one], image[other], centers[one], centers[other], nearest, epipole
                )
                xa, ya = pose[a, 4], pose[a, 5]
                dxa, dya, ca, fa, la, wa = line_a[0], line_a[1], line_a[2], line_a[3], line_a[4], line_a[5]
                for b in range(start[q], start[q + 1]):
                    xb, yb, line = pose[b, 4], pose[b, 5], lines_b[b]
                    dxb, dyb, cb, fb, lb, wb = line[0], line[1], line[2], line[3], line[4], line[5]
                    total = 0.0
                    for j in range(padded):  # no branches, so that it vectorises over joints
                        beside = dxa[j] * yb[j] - dya[j] * xb[j] + ca[j]
                        along = dxa[j] * xb[j] + dya[j] * yb[j]
                        beyond = max(fa[j] - along, along - la[j], 0.0)
                        distance_in_b = min(math.sqrt(beside * beside + beyond * beyond), saturation)
                        beside = dxb[j] * ya[j] - dyb[j] * xa[j] + cb[j]
                        along = dxb[j] * xa[j] + dyb[j] * ya[j]
                        beyond = max(fb[j] - along, along - lb[j], 0.0)
                        distance_in_a = min(math.sqrt(beside * beside + beyond * beyond), saturation)
                        total += wa[j] * wb[j] * (0.5 * (distance_in_b + distance_in_a) - threshold)
                    excess[b] = total
                for b in range(start[q], start[q + 1]):
                    if excess[b] > 0.0 and not distances:  # the mean distance exceeds the threshold
                        continue
                    mass, count = shared_joints(wa, lines_b[b, 5])
                    if count < least:
                        continue
                    i, k = order[a], order[b]
                    distance = threshold + excess[b] / mass
                    result[i, k] = result[k, i] = distance if distances else scalar_sigmoid(distance, midpoint, slope)
    return result


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _epipolar_lines(line, pose, matrix, other_matrix, center, other_center, nearest, epipole):
    """Write a pose's epipolar lines in another view: unit direction (2), offset, start and end along it, weight."""
    ax = ay = az = bx = by = bz = 0.0  # epipoles, homogeneous: of this centre in the other view, and the reverse
    apart = False
    for r in range(3):
        apart = apart or abs(center[r] - other_center[r]) > _SAME_POINT
    for r in range(3):
        step = center[r] - other_center[r] if apart else 0.0
        ax, ay, az = ax + other_matrix[0, r] * step, ay + other_matrix[1, r] * step, az + other_matrix[2, r] * step
        bx, by, bz = bx - matrix[0, r] * step, by - matrix[1, r] * step, bz - matrix[2, r] * step
    for j in range(pose.shape[1]):
        x, y, z = pose[0, j], pose[1, j], pose[2, j]
        vx = other_matrix[0, 0] * x + other_matrix[0, 1] * y + other_matrix[0, 2] * z  # vanishing point of the ray
        vy = other_matrix[1, 0] * x + other_matrix[1, 1] * y + other_matrix[1, 2] * z
        vz = other_matrix[2, 0] * x + other_matrix[2, 1] * y + other_matrix[2, 2] * z
        dx, dy, offset = az * vx - ax * vz, az * vy - ay * vz, ax * vy - ay * vx
        length = math.sqrt(dx * dx + dy * dy)
        depth = az + nearest * vz
        if length > 0.0:
            dx, dy, offset = dx / length, dy / length, offset / length
            begin = (dx * (ax + nearest * vx) + dy * (ay + nearest * vy)) / depth if depth > 0.0 else -_FAR
            end = (dx * vx + dy * vy) / vz if vz > 0.0 else _FAR
        else:  # the centres coincide, or the ray passes through the other centre
            dx, dy = 1.0, 0.0
            begin = end = vx / vz if vz > 0.0 else _FAR
            offset = -vy / vz if vz > 0.0 else _FAR
        if depth <= 0.0 and vz <= 0.0:
            begin, end = _FAR, -_FAR  # the whole ray is behind the other camera
        line[0, j], line[1, j], line[2, j] = dx, dy, offset
        line[3, j], line[4, j] = max(begin, -_FAR), min(end, _FAR)
        off_x, off_y = pose[4, j] * bz - bx, pose[5, j] * bz - by
        known = off_x * off_x + off_y * off_y > epipole * epipole * bz * bz or bz == 0.0
        line[5, j] = pose[3, j] if known else 0.0
