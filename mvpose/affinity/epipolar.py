"""The paper's geometric cue: the symmetric distance from points to epipolar lines, in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from mvpose.affinity.base import FASTMATH, Floats, by_view, falling, in_common, lay_out
from mvpose.camera import Rig
from mvpose.checks import check_numbers
from mvpose.detections import Detections
from mvpose.rays import Rays, viewing_rays

_WIDTH = 1000.0  # pixels across the image in which distances are counted
_FAR = 1e9  # pixels: farther than any image reaches
_SAME_POINT = 1e-6  # metres; no calibration tells centres so near from one


@dataclass(frozen=True)
class EpipolarAffinity:
    """Affinity from the paper's D_g (section 3.2): how far joints lie from each other's epipolar lines, both ways.

    Distances are in pixels of an image 1000 pixels wide (times 1000 / width of the view they are measured in), lens
    distortion undone, so that one scale serves 360 x 288 and 4K; the paper's experiments are on images about as wide.

    Against the paper, a line ends where the ray does: it is the image of what lies at least ``nearest`` ahead of
    the other camera, and ahead of this one. A joint that lies beyond an end is measured to that end, and one whose
    ray this camera cannot see at all counts ``saturation``: so poses do not match by lines that meet behind a camera.
    Of two cameras in one point the line is just the point where the other ray vanishes.

    Attributes:
        midpoint: distance in pixels at which a match is as likely as not (affinity 1/2). A person of usual size fills
            300 of the 1000 pixels; keypoints then scatter by 10 pixels in every direction (OKS sigmas of the limbs)
            and lie 12 from their lines on average. So these are the scales of
            :class:`mvpose.affinity.GeometricAffinity`, at 175 pixels a metre.
        slope: pixels over which the affinity falls from 1/2 to 1/(1 + e).
        threshold: the paper's ``th``: the affinity is 0 beyond this distance, pixels.
        saturation: a joint counts at most this far off, pixels, each way.
        least_joints: poses that share fewer joints than this are not compared; their affinity is 0.
        nearest: where a viewing ray starts, metres from the optical centre.
        epipole: a joint within so many pixels of the other camera's image has no line with a direction, as keypoints
            scatter so much; it is left out, as one that is missing.

    Raises:
        ValueError: a scale that is not above 0.
    """

    midpoint: float = 26.0
    slope: float = 7.0
    threshold: float = 44.0
    saturation: float = 88.0
    least_joints: int = 3
    nearest: float = 0.5
    epipole: float = 10.0

    def __post_init__(self) -> None:
        check_numbers(
            self,
            "the epipolar affinity",
            positive=("midpoint", "slope"),
            limits=("threshold", "saturation"),
            not_negative=("nearest", "epipole"),
        )

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`."""
        return _compare_lines(
            rays.view, rays.directions, rays.weights, rig.centers, _image(rig), self.nearest, self.epipole,
            self.saturation, self.midpoint, self.slope, self.threshold, max(self.least_joints, 1), False,
        )  # fmt: skip


def epipolar_distance(rig: Rig, detections: Detections) -> Floats:
    """The paper's D_g: symmetric point-to-epipolar-line distance averaged over joints, weighted by both scores.

    Args:
        rig: V cameras.
        detections: m poses.

    Returns:
        Distances, (m, m), pixels of an image 1000 pixels wide, without lens distortion, lines cut where the rays end
        (:class:`EpipolarAffinity`); infinite for two poses of one view or without a common joint off the epipoles.
    """
    rays = viewing_rays(rig, detections)
    return _compare_lines(
        rays.view, rays.directions, rays.weights, rig.centers, _image(rig), 0.0, 0.0, np.inf, 0.0, 1.0, 0.0, 1, True
    )


def _image(rig: Rig) -> Floats:
    """Directions in the world to homogeneous pixels of images 1000 pixels wide, (V, 3, 3)."""
    matrices = rig.P[:, :, :3].copy()
    matrices[:, :2] *= _WIDTH / np.array([camera.size[0] for camera in rig])[:, None, None]
    return matrices


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _compare_lines(
    view, directions, weights, centers, image, nearest, epipole, saturation, midpoint, slope, threshold, least,
    distances,
):  # fmt: skip
    """Affinities; or, with ``distances``, the mean distances."""
    order, start = by_view(view)
    pose = lay_out(directions, weights, order, 6)  # and the pixel
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
                _draw(lines_b[b], pose[b], image[other], image[one], centers[other], centers[one],
                      nearest, epipole)  # fmt: skip
            for a in range(start[p], start[p + 1]):
                _draw(line_a, pose[a], image[one], image[other], centers[one], centers[other],
                      nearest, epipole)  # fmt: skip
                xa, ya = pose[a, 4], pose[a, 5]
                dxa, dya, ca, fa, la, wa = line_a[0], line_a[1], line_a[2], line_a[3], line_a[4], line_a[5]
                for b in range(start[q], start[q + 1]):
                    xb, yb, line = pose[b, 4], pose[b, 5], lines_b[b]
                    dxb, dyb, cb, fb, lb, wb = line[0], line[1], line[2], line[3], line[4], line[5]
                    total = 0.0
                    for j in range(padded):  # no branch, so that it runs on whole registers of joints
                        beside = dxa[j] * yb[j] - dya[j] * xb[j] + ca[j]
                        along = dxa[j] * xb[j] + dya[j] * yb[j]
                        beyond = max(fa[j] - along, along - la[j], 0.0)
                        there = min(math.sqrt(beside * beside + beyond * beyond), saturation)
                        beside = dxb[j] * ya[j] - dyb[j] * xa[j] + cb[j]
                        along = dxb[j] * xa[j] + dyb[j] * ya[j]
                        beyond = max(fb[j] - along, along - lb[j], 0.0)
                        back = min(math.sqrt(beside * beside + beyond * beyond), saturation)
                        total += wa[j] * wb[j] * (0.5 * (there + back) - threshold)
                    excess[b] = total
                for b in range(start[q], start[q + 1]):
                    if excess[b] > 0.0 and not distances:  # on average beyond the threshold
                        continue
                    mass, count = in_common(wa, lines_b[b, 5])
                    if count < least:
                        continue
                    i, k = order[a], order[b]
                    distance = threshold + excess[b] / mass
                    result[i, k] = result[k, i] = distance if distances else falling(distance, midpoint, slope)
    return result


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _draw(line, pose, own, other, center, other_center, nearest, epipole):
    """Draw a pose's rays in another view: unit direction, offset, where along it the image starts and ends, weight."""
    ax = ay = az = bx = by = bz = 0.0  # homogeneous images of this centre in the other view, and of the other in this
    apart = False
    for r in range(3):
        apart = apart or abs(center[r] - other_center[r]) > _SAME_POINT
    for r in range(3):
        step = center[r] - other_center[r] if apart else 0.0
        ax, ay, az = ax + other[0, r] * step, ay + other[1, r] * step, az + other[2, r] * step
        bx, by, bz = bx - own[0, r] * step, by - own[1, r] * step, bz - own[2, r] * step
    for j in range(pose.shape[1]):
        x, y, z = pose[0, j], pose[1, j], pose[2, j]
        vx = other[0, 0] * x + other[0, 1] * y + other[0, 2] * z  # where the ray vanishes
        vy = other[1, 0] * x + other[1, 1] * y + other[1, 2] * z
        vz = other[2, 0] * x + other[2, 1] * y + other[2, 2] * z
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
            begin, end = _FAR, -_FAR  # all of the ray is behind the other camera
        line[0, j], line[1, j], line[2, j] = dx, dy, offset
        line[3, j], line[4, j] = max(begin, -_FAR), min(end, _FAR)
        off_x, off_y = pose[4, j] * bz - bx, pose[5, j] * bz - by
        known = off_x * off_x + off_y * off_y > epipole * epipole * bz * bz or bz == 0.0
        line[5, j] = pose[3, j] if known else 0.0
