"""Agreement of pairs of views about the people in them: likelihood of their tracklets, without any reconstruction.

Two keypoints show one joint only if their viewing rays meet in front of both cameras. The distance of the rays in units
of the keypoints' errors (Sampson distance: Hartley & Zisserman, Multiple View Geometry, section 11.4.3) does not depend
on the scale of the rig, so it compares readings of a calibration that differ in their units. Its distribution for one
joint is compared with that for places drawn independently from the two pictures: the logarithm of their ratio is the
evidence for a reading.

Tracklets are matched as a whole over seconds. Single poses of different people often fit by chance, those of two
people who move rarely do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.pieces import Pieces
from mvpose.kernels import njit
from mvpose.lens import undistort

ViewRays = tuple[Integers, Integers, Integers, Integers, Floats, Floats]
"""Detections of a view: first one of each window (W + 1,), number of pieces in each (W,), and of each its frame (n,),
piece (n,), normalised coordinates (n, J, 2) and their standard deviations (n, J)."""

WRONG = 0.2  # share of keypoints that are wrong by more than the error model (Ronchi & Perona: misses, swaps, hidden)
_NEGLIGIBLE = 40.0  # exponent from which e^-x is nothing beside WRONG


@dataclass(frozen=True)
class Reading:
    """One way to read the files of a rig and its detections."""

    cameras: Floats
    """Intrinsics, rotation, centre and distortion of each camera as :attr:`mvpose.Rig.packed` has them, (V, 22)."""
    pixels: Floats
    """Affine map from detected pixels to those that the camera is calibrated for, (V, 2, 3)."""
    exchanged: Bools
    """Whether left and right joints of a view have each other's names, (V,)."""

    @classmethod
    def as_given(cls, cameras: Floats) -> Self:
        """Return the reading that takes the files as they are."""
        pixels = np.zeros((len(cameras), 2, 3))
        pixels[:, 0, 0] = pixels[:, 1, 1] = 1.0
        return cls(cameras, pixels, np.zeros(len(cameras), np.bool_))


class Consistency:
    """Evidence that each pair of views agrees, of one reading after the other.

    Values of views whose reading did not change are kept, so that a reading that differs in one camera costs little.
    """

    _MOST_RAYS, _MOST_PAIRS = 64, 4096  # values that are kept; those of a view take a megabyte

    def __init__(self, pieces: Pieces) -> None:
        self.pieces = pieces
        self._rays: dict[tuple[int, bytes], tuple[ViewRays, Floats]] = {}
        self._pairs: dict[tuple[int, int, bytes, bytes], Floats] = {}

    def __call__(self, reading: Reading) -> Floats:
        """Return the log likelihood ratio of one world to chance, (V, V, W); 0 where nobody is shared.

        Entries below the diagonal are 0.
        """
        return self._of_pairs(reading, self._pair)

    def ideal(self, reading: Reading) -> Floats:
        """Return what ``self(reading)`` would be if rays of the same people met as well as the errors allow, (V, V, W).

        Detections of both views are paired at each time, also those of different people: matched people with each
        other first, then the others.
        """
        return self._of_pairs(reading, lambda *pair: best_evidence(*self._views(*pair), True))

    def _of_pairs(self, reading: Reading, value: Callable[[Reading, list[bytes], int, int], Floats]) -> Floats:
        keys = [_key(reading, view) for view in range(len(reading.cameras))]
        result = np.zeros((len(keys), len(keys), self.pieces.windows))
        for i, j in zip(*np.triu_indices(len(keys), 1), strict=True):
            result[i, j] = value(reading, keys, int(i), int(j))
        return result

    def of_pair(self, reading: Reading, i: int, j: int, *, ideal: bool = False) -> float:
        """Return the evidence of two views, i before j, alone; at its best if ``ideal``, as :meth:`ideal`."""
        keys = [_key(reading, view) for view in range(len(reading.cameras))]
        return float(best_evidence(*self._views(reading, keys, i, j), ideal).sum())

    def agreement(self, reading: Reading) -> Floats:
        """Return the evidence of each camera's pairs as a share of what it would be at best, (V,)."""
        evidence, ideal = (each.sum(axis=2) for each in (self(reading), self.ideal(reading)))
        evidence, ideal = (each + each.T for each in (evidence, ideal))
        return evidence.sum(axis=1) / np.maximum(ideal.sum(axis=1), 1e-9)

    def matched_rows(self, reading: Reading, i: int, j: int) -> tuple[Integers, Integers]:
        """Return the detections of two views, i before j, that are matched under a reading, (n,) each.

        They are counted from the first detection of each view, as :meth:`normalised` returns them.
        """
        views = self._views(reading, [_key(reading, view) for view in range(len(reading.cameras))], i, j)
        (bounds_a, _, frames_a, pieces_a, *_), (bounds_b, _, frames_b, pieces_b, *_) = views[:2]
        one, other = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        for w in range(self.pieces.windows):
            for a, b in assigned(window_sums(*views, w, False)).tolist():
                first = bounds_a[w] + np.flatnonzero(pieces_a[bounds_a[w] : bounds_a[w + 1]] == a)
                second = bounds_b[w] + np.flatnonzero(pieces_b[bounds_b[w] : bounds_b[w + 1]] == b)
                _, left, right = np.intersect1d(frames_a[first], frames_b[second], return_indices=True)
                one.append(first[left])
                other.append(second[right])
        return np.concatenate(one), np.concatenate(other)

    def normalised(self, reading: Reading, view: int) -> tuple[Floats, Floats]:
        """Return the normalised coordinates of a view's detections, (n, J, 2), and their standard deviations (n, J)."""
        rays, _ = self._view_rays(reading, _key(reading, view), view)
        return rays[4], rays[5]

    def rays(self, reading: Reading, view: int) -> Floats:
        """Return the viewing rays of a view's detections in the world, (n, J, 3), of depth 1; NaN where missing."""
        points, _ = self.normalised(reading, view)
        rotation = reading.cameras[view, 5:14].reshape(3, 3)
        return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ rotation

    def _pair(self, reading: Reading, keys: list[bytes], i: int, j: int) -> Floats:
        key = (i, j, keys[i], keys[j])
        if key not in self._pairs:
            _make_room(self._pairs, self._MOST_PAIRS)
            self._pairs[key] = best_evidence(*self._views(reading, keys, i, j), False)
        return self._pairs[key]

    def _views(self, reading: Reading, keys: list[bytes], i: int, j: int) -> tuple[ViewRays, ViewRays, Floats, Floats]:
        """Return the detections, spreads (2, 2, 2) and cameras (2, 22) of two views."""
        first, second = self._view_rays(reading, keys[i], i), self._view_rays(reading, keys[j], j)
        return first[0], second[0], np.stack([first[1], second[1]]), reading.cameras[[i, j]]

    def _view_rays(self, reading: Reading, key: bytes, view: int) -> tuple[ViewRays, Floats]:
        """Return the detections of a view with normalised coordinates, and the covariance of these, (2, 2)."""
        if (view, key) not in self._rays:
            _make_room(self._rays, self._MOST_RAYS)
            p = self.pieces
            first, last = p.start[view, 0], p.stop[view, -1]
            keypoints, sigma = p.keypoints[first:last], p.sigma[first:last]
            if reading.exchanged[view]:
                keypoints, sigma = keypoints[:, p.mirror], sigma[:, p.mirror]
            points, errors, spread = normalised(
                np.ascontiguousarray(keypoints),
                np.ascontiguousarray(sigma),
                reading.cameras[view],
                reading.pixels[view],
            )
            bounds = np.append(p.start[view], last) - first
            rays = (bounds, p.count[view], p.frame[first:last], p.piece[first:last], points, errors)
            self._rays[view, key] = rays, spread
        return self._rays[view, key]


def _make_room(kept: dict[Any, Any], most: int) -> None:
    """Drop the oldest values of a dictionary that has as many as it may have."""
    while len(kept) >= most:
        del kept[next(iter(kept))]


def _key(reading: Reading, view: int) -> bytes:
    return reading.cameras[view].tobytes() + reading.pixels[view].tobytes() + reading.exchanged[view].tobytes()


@njit(cache=True)
def assigned(sums):
    """Return the best pairs (n, 2), each piece in one at most; greedy, the clearest pair first."""
    left, found, count = sums.copy(), np.empty((min(sums.shape), 2), np.int64), 0
    while left.size:
        best = np.argmax(left)
        a, b = best // left.shape[1], best % left.shape[1]
        if left[a, b] <= 0.0:
            break
        found[count] = a, b
        count += 1
        left[a, :] = 0.0
        left[:, b] = 0.0
    return found[:count]


@njit(cache=True)
def _assign(sums):
    """Return the evidence of the best pairs."""
    total = 0.0
    for pair in assigned(sums):
        total += sums[pair[0], pair[1]]
    return total


@njit(cache=True)
def normalised(keypoints, sigma, camera, pixels):
    """Return undistorted normalised coordinates (n, J, 2), their standard deviations (n, J) and covariance (2, 2).

    Args:
        keypoints: pixels as detected, (n, J, 2); NaN where missing.
        sigma: standard deviation of each keypoint, (n, J), pixels; infinite where missing.
        camera: packed camera, (22,).
        pixels: affine map from detected pixels to those of the calibration, (2, 3).
    """
    fx, skew, cx, fy, cy, lens = camera[0], camera[1], camera[2], camera[3], camera[4], camera[17:22]
    zoom = np.sqrt(abs(pixels[0, 0] * pixels[1, 1] - pixels[0, 1] * pixels[1, 0]) / (fx * fy))
    points, errors = np.full(keypoints.shape, np.nan), np.full(sigma.shape, np.inf)
    count, mean, squares = 0, np.zeros(2), np.zeros((2, 2))
    for d in range(len(keypoints)):
        for j in range(keypoints.shape[1]):
            px, py = keypoints[d, j]
            u = pixels[0, 0] * px + pixels[0, 1] * py + pixels[0, 2]
            v = pixels[1, 0] * px + pixels[1, 1] * py + pixels[1, 2]
            v = (v - cy) / fy
            u = (u - cx - skew * v) / fx
            x, y = undistort(u, v, lens)
            points[d, j] = x, y
            errors[d, j] = sigma[d, j] * zoom
            if np.isfinite(x) and np.isfinite(y) and np.isfinite(errors[d, j]):
                # Welford's update keeps the digits of a small spread about a large mean.
                count += 1
                dx, dy = x - mean[0], y - mean[1]
                mean[0] += dx / count
                mean[1] += dy / count
                squares[0, 0] += dx * (x - mean[0])
                squares[0, 1] += dx * (y - mean[1])
                squares[1, 1] += dy * (y - mean[1])
    squares[1, 0] = squares[0, 1]
    return points, errors, squares / (count - 1) if count > 2 else np.eye(2)


@njit(cache=True)
def best_evidence(first, second, spreads, cameras, ideal):
    """Return the evidence of the best pairs of pieces of two views in each window, (W,); their most if ``ideal``.

    Args:
        first: first detection of each window (W + 1,), number of pieces in each (W,), and of each detection its frame
            (n,), piece (n,), normalised coordinates (n, J, 2) and their standard deviations (n, J).
        second: the same of the other view.
        spreads: covariance of all coordinates of each view, (2, 2, 2).
        cameras: the two packed cameras, (2, 22).
        ideal: whether keypoints count as if they had no errors.
    """
    windows = len(first[1])
    result = np.zeros(windows)
    for w in range(windows):
        if first[1][w] and second[1][w]:
            sums = window_sums(first, second, spreads, cameras, w, False)
            result[w] = _ideal(sums, window_sums(first, second, spreads, cameras, w, True)) if ideal else _assign(sums)
    return result


@njit(cache=True)
def evidence_and_most(first, second, spreads, cameras):
    """Return :func:`best_evidence`, and its most, of each window, (W, 2); the arguments are the same."""
    result = np.zeros((len(first[1]), 2))
    for w in range(len(first[1])):
        if first[1][w] and second[1][w]:
            sums = window_sums(first, second, spreads, cameras, w, False)
            result[w] = _assign(sums), _ideal(sums, window_sums(first, second, spreads, cameras, w, True))
    return result


@njit(cache=True)
def _ideal(sums, most):
    """Return the most evidence of the best pairs, and of the best of the pieces that are left.

    Of two people in one view and one in the other, another than the one who is matched may have more keypoints.
    """
    total, left = 0.0, most.copy()
    for pair in assigned(sums):
        total += most[pair[0], pair[1]]
        left[pair[0], :] = 0.0
        left[:, pair[1]] = 0.0
    return total + _assign(left)


@njit(cache=True)
def window_sums(first, second, spreads, cameras, window, ideal):
    """Return the log likelihood ratios of all pairs of pieces of two views in one window, (A, B).

    The arguments are those of :func:`best_evidence`. Detections of each view are sorted by frame.
    """
    bounds_a, counts_a, frames_a, pieces_a, points_a, errors_a = first
    bounds_b, counts_b, frames_b, pieces_b, points_b, errors_b = second
    sums = np.zeros((counts_a[window], counts_b[window]))
    essential, rotation, base = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    _relative(cameras[0], cameras[1], rotation, base, essential)
    low, end = bounds_b[window], bounds_b[window + 1]
    for a in range(bounds_a[window], bounds_a[window + 1]):
        while low < end and frames_b[low] < frames_a[a]:
            low += 1
        for b in range(low, end):
            if frames_b[b] != frames_a[a]:
                break
            sums[pieces_a[a], pieces_b[b]] += _pose_evidence(
                points_a[a], errors_a[a], points_b[b], errors_b[b], spreads, rotation, base, essential, ideal
            )
    return sums


@njit(cache=True, borrows=True)
def _pose_evidence(points_a, errors_a, points_b, errors_b, spreads, rotation, base, essential, ideal):
    """Return the log likelihood ratio of two poses (J, 2) to be of one person."""
    total, product = 0.0, 1.0
    for j in range(len(points_a)):
        x, y = points_a[j], points_b[j]
        error_a, error_b = errors_a[j], errors_b[j]
        if not (error_a < np.inf and error_b < np.inf) or np.isnan(x[0]) or np.isnan(y[0]):
            continue
        # Gradients of yᵀ E x.
        hx = essential[0, 0] * x[0] + essential[0, 1] * x[1] + essential[0, 2]
        hy = essential[1, 0] * x[0] + essential[1, 1] * x[1] + essential[1, 2]
        hz = essential[2, 0] * x[0] + essential[2, 1] * x[1] + essential[2, 2]
        gx = essential[0, 0] * y[0] + essential[1, 0] * y[1] + essential[2, 0]
        gy = essential[0, 1] * y[0] + essential[1, 1] * y[1] + essential[2, 1]
        value = y[0] * hx + y[1] * hy + hz
        noise = (gx * gx + gy * gy) * error_a**2 + (hx * hx + hy * hy) * error_b**2
        if not noise > 0.0:
            continue
        chance = _form(spreads[0], gx, gy) + _form(spreads[1], hx, hy) + noise
        if ideal:
            product *= WRONG + (1.0 - WRONG) * np.sqrt(chance / noise)
        else:
            ratio, exponent = WRONG, 0.5 * value * value * (1 / noise - 1 / chance)
            if exponent < _NEGLIGIBLE and _in_front(x, y, rotation, base):
                ratio += (1.0 - WRONG) * np.sqrt(chance / noise) * np.exp(-exponent)
            product *= ratio
        if not 1e-100 < product < 1e100:  # one logarithm for many joints
            total += np.log(product)
            product = 1.0
    return total + np.log(product)


@njit(cache=True, borrows=True)
def _form(matrix, x, y):
    return matrix[0, 0] * x * x + 2.0 * matrix[0, 1] * x * y + matrix[1, 1] * y * y


@njit(cache=True, borrows=True)
def _relative(first, second, rotation, base, essential):
    """Write rotation and translation from the first camera to the second, and the essential matrix of unit baseline."""
    for r in range(3):
        base[r] = 0.0
        for c in range(3):
            rotation[r, c] = 0.0
            base[r] += second[5 + 3 * r + c] * (first[14 + c] - second[14 + c])
            for k in range(3):
                rotation[r, c] += second[5 + 3 * r + k] * first[5 + 3 * c + k]
    length = np.sqrt(base[0] ** 2 + base[1] ** 2 + base[2] ** 2)
    for r in range(3):
        base[r] = base[r] / length if length > 0.0 else 0.0
    for c in range(3):
        essential[0, c] = base[1] * rotation[2, c] - base[2] * rotation[1, c]
        essential[1, c] = base[2] * rotation[0, c] - base[0] * rotation[2, c]
        essential[2, c] = base[0] * rotation[1, c] - base[1] * rotation[0, c]


@njit(cache=True, borrows=True)
def _in_front(x, y, rotation, base):
    """Whether the rays (x, 1) and (y, 1) come closest to each other in front of both cameras."""
    u0 = rotation[0, 0] * x[0] + rotation[0, 1] * x[1] + rotation[0, 2]
    u1 = rotation[1, 0] * x[0] + rotation[1, 1] * x[1] + rotation[1, 2]
    u2 = rotation[2, 0] * x[0] + rotation[2, 1] * x[1] + rotation[2, 2]
    uu, yy = u0 * u0 + u1 * u1 + u2 * u2, y[0] * y[0] + y[1] * y[1] + 1.0
    uy = u0 * y[0] + u1 * y[1] + u2
    ub = u0 * base[0] + u1 * base[1] + u2 * base[2]
    yb = y[0] * base[0] + y[1] * base[1] + base[2]
    # Least squares of base + s u = r y; the determinant is not negative.
    return uy * yb - yy * ub > 0.0 and uu * yb - uy * ub > 0.0
