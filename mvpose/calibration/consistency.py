"""How well cameras agree on who stands where: likelihood of the tracklets of two views, without any reconstruction.

Two keypoints show one joint only if their viewing rays meet in front of both cameras. The distance of the rays in units
of the keypoints' errors (Sampson distance: Hartley & Zisserman, Multiple View Geometry, section 11.4.3) does not depend
on the scale of the rig, so it compares readings of a calibration that differ in their units. Its distribution for one
joint is compared with that for places drawn independently from the two pictures: what is left is the evidence that the
cameras are as the reading has them.

Tracklets are matched as a whole over seconds. Single poses of different people often fit by chance, those of two
people who move rarely do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.tracklets import Tracklets, chosen_frames
from mvpose.kernels import njit
from mvpose.lens import undistort

_SPACING = 0.2  # seconds between frames that are compared; errors of detectors last longer
_WINDOW = 2.0  # seconds over which tracklets are matched as a whole; in it a walking person takes four steps
_WRONG = 0.2  # share of keypoints that are wrong by more than the error model (Ronchi & Perona: misses, swaps, hidden)


@dataclass(frozen=True)
class Pieces:
    """Tracklets cut into windows of time: what is matched between views.

    Attributes:
        keypoints: pixels as detected, (n, J, 2); NaN where missing.
        sigma: standard deviation of each keypoint, pixels, (n, J); infinite where missing.
        view: view of each detection, (n,).
        frame: frame of each detection, (n,).
        tracklet: tracklet of each detection, (n,).
        piece: piece of each detection, (n,), counted within its view and window.
        start: first detection of each view and window, (V, W); detections are sorted by view, window, frame.
        stop: one past the last one, (V, W).
        count: number of pieces of each view and window, (V, W).
        mirror: left-right counterpart of each joint, (J,).
    """

    keypoints: Floats
    sigma: Floats
    view: Integers
    frame: Integers
    tracklet: Integers
    piece: Integers
    start: Integers
    stop: Integers
    count: Integers
    mirror: Integers

    @property
    def windows(self) -> int:
        """Number of windows, W."""
        return self.start.shape[1]


def cut(tracklets: Tracklets, *, spacing: float = _SPACING, window: float = _WINDOW) -> Pieces:
    """Return the detections of frames about ``spacing`` seconds apart, in windows of ``window`` seconds."""
    views = tracklets.times.shape[1]
    chosen = chosen_frames(tracklets, spacing=spacing)
    when = np.full(len(chosen), np.nan)
    when[chosen] = np.nanmedian(tracklets.times[chosen], axis=1)
    kept = chosen[tracklets.frame]
    frame, view, tracklet = tracklets.frame[kept], tracklets.view[kept], tracklets.tracklet[kept]
    number = np.floor((when[frame] - when[chosen].min(initial=np.inf)) / window + 1e-9).astype(np.int64)
    _, number = np.unique(number, return_inverse=True)  # windows without detections do not count
    windows = int(number.max(initial=-1)) + 1
    order = np.lexsort((tracklet, frame, number, view))
    frame, view, tracklet, number = frame[order], view[order], tracklet[order], number[order]
    cell = view * windows + number
    start = np.searchsorted(cell, np.arange(views * windows)).reshape(views, windows)
    stop = np.searchsorted(cell, np.arange(views * windows), side="right").reshape(views, windows)
    piece, count = np.zeros(len(cell), np.int64), np.zeros((views, windows), np.int64)
    for v in range(views):
        for w in range(windows):
            names, piece[start[v, w] : stop[v, w]] = np.unique(tracklet[start[v, w] : stop[v, w]], return_inverse=True)
            count[v, w] = len(names)
    return Pieces(
        tracklets.keypoints[kept][order],
        tracklets.sigma[kept][order],
        view,
        frame,
        tracklet,
        piece,
        start,
        stop,
        count,
        np.array(tracklets.skeleton.mirror, np.int64),
    )


@dataclass(frozen=True)
class Reading:
    """One way to read the files of a rig and its detections.

    Attributes:
        cameras: intrinsics, rotation, centre and distortion of each camera as :attr:`mvpose.Rig.packed` has them,
            (V, 22).
        pixels: affine map from detected pixels to those that the camera is calibrated for, (V, 2, 3).
        exchanged: whether left and right joints of a view have each other's names, (V,).
    """

    cameras: Floats
    pixels: Floats
    exchanged: Bools

    @classmethod
    def as_given(cls, cameras: Floats) -> Reading:
        """Return the reading that takes the files as they are."""
        pixels = np.zeros((len(cameras), 2, 3))
        pixels[:, 0, 0] = pixels[:, 1, 1] = 1.0
        return cls(cameras, pixels, np.zeros(len(cameras), np.bool_))


class Consistency:
    """Evidence that each pair of views agrees, of one reading after the other.

    Values of views whose reading did not change are kept, so that a reading that differs in one camera costs little.
    """

    def __init__(self, pieces: Pieces) -> None:
        self.pieces = pieces
        self._rays: dict[tuple[int, bytes], tuple[Floats, Floats, Floats]] = {}
        self._pairs: dict[tuple[int, int, bytes, bytes], Floats] = {}

    def __call__(self, reading: Reading) -> Floats:
        """Return the log likelihood ratio of one world to chance, (V, V, W); 0 where nobody is shared.

        Entries below the diagonal are 0.
        """
        views = len(reading.cameras)
        keys = [_key(reading, view) for view in range(views)]
        result = np.zeros((views, views, self.pieces.windows))
        for i in range(views):
            for j in range(i + 1, views):
                result[i, j] = self._pair(reading, keys, i, j)
        return result

    def ideal(self, reading: Reading) -> Floats:
        """Return what ``self(reading)`` would be if rays of the same people met as well as the errors allow, (V, V, W).

        All that is seen in both views at a time counts, whether it is of the same people or not.
        """
        views = len(reading.cameras)
        keys = [_key(reading, view) for view in range(views)]
        result = np.zeros((views, views, self.pieces.windows))
        for i in range(views):
            for j in range(i + 1, views):
                result[i, j] = [_assign(each[1]) for each in self._sums(reading, keys, i, j)]
        return result

    def pairs(self, reading: Reading) -> Iterator[tuple[int, int, int, Integers]]:
        """Yield view, view, window and the matched pieces (n, 2) under a reading."""
        keys = [_key(reading, view) for view in range(len(reading.cameras))]
        for i in range(len(keys)):
            for j in range(i + 1, len(keys)):
                for w, sums in enumerate(self._sums(reading, keys, i, j)):
                    yield i, j, w, _assigned(sums[0])

    def rays(self, reading: Reading, view: int) -> Floats:
        """Return the viewing rays of a view's detections in the world, (n, J, 3), of depth 1; NaN where missing."""
        points = self._view_rays(reading, _key(reading, view), view)[0]
        rotation = reading.cameras[view, 5:14].reshape(3, 3)
        return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ rotation

    def _pair(self, reading: Reading, keys: list[bytes], i: int, j: int) -> Floats:
        key = (i, j, keys[i], keys[j])
        if key not in self._pairs:
            sums = self._sums(reading, keys, i, j)
            self._pairs[key] = np.array([_assign(each[0]) for each in sums])
        return self._pairs[key]

    def _sums(self, reading: Reading, keys: list[bytes], i: int, j: int) -> list[Floats]:
        first, second = self._view_rays(reading, keys[i], i), self._view_rays(reading, keys[j], j)
        p = self.pieces
        result = []
        for w in range(p.windows):
            sums = np.zeros((2, p.count[i, w], p.count[j, w]))
            if sums.size:
                a = slice(p.start[i, w], p.stop[i, w])
                b = slice(p.start[j, w], p.stop[j, w])
                low_a, low_b = p.start[i, 0], p.start[j, 0]
                inside_a = slice(a.start - low_a, a.stop - low_a)
                inside_b = slice(b.start - low_b, b.stop - low_b)
                _add_evidence(
                    sums,
                    (p.frame[a], p.piece[a], first[0][inside_a], first[1][inside_a]),
                    (p.frame[b], p.piece[b], second[0][inside_b], second[1][inside_b]),
                    (first[2], second[2]),
                    (reading.cameras[i], reading.cameras[j]),
                    _WRONG,
                )
            result.append(sums)
        return result

    def _view_rays(self, reading: Reading, key: bytes, view: int) -> tuple[Floats, Floats, Floats]:
        """Return normalised coordinates (n, J, 2), their standard deviations (n, J) and their covariance (2, 2)."""
        if (view, key) not in self._rays:
            start, stop = self.pieces.start[view, 0], self.pieces.stop[view, -1]
            keypoints, sigma = self.pieces.keypoints[start:stop], self.pieces.sigma[start:stop]
            if reading.exchanged[view]:
                keypoints, sigma = keypoints[:, self.pieces.mirror], sigma[:, self.pieces.mirror]
            points, errors = _normalised(
                np.ascontiguousarray(keypoints),
                np.ascontiguousarray(sigma),
                reading.cameras[view],
                reading.pixels[view],
            )
            seen = points[np.isfinite(points).all(axis=-1) & np.isfinite(errors)]
            spread = np.cov(seen.T) if len(seen) > 2 else np.eye(2)
            self._rays[view, key] = points, errors, np.ascontiguousarray(spread)
        return self._rays[view, key]


def _key(reading: Reading, view: int) -> bytes:
    return reading.cameras[view].tobytes() + reading.pixels[view].tobytes() + reading.exchanged[view].tobytes()


@njit(cache=True)
def _assigned(sums):
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
    for pair in _assigned(sums):
        total += sums[pair[0], pair[1]]
    return total


@njit(cache=True)
def _normalised(keypoints, sigma, camera, pixels):
    """Return undistorted normalised coordinates (n, J, 2) and their standard deviations (n, J)."""
    fx, skew, cx, fy, cy, lens = camera[0], camera[1], camera[2], camera[3], camera[4], camera[17:22]
    zoom = np.sqrt(abs(pixels[0, 0] * pixels[1, 1] - pixels[0, 1] * pixels[1, 0]) / (fx * fy))
    points, errors = np.full(keypoints.shape, np.nan), np.full(sigma.shape, np.inf)
    for d in range(len(keypoints)):
        for j in range(keypoints.shape[1]):
            px, py = keypoints[d, j]
            u = pixels[0, 0] * px + pixels[0, 1] * py + pixels[0, 2]
            v = pixels[1, 0] * px + pixels[1, 1] * py + pixels[1, 2]
            v = (v - cy) / fy
            u = (u - cx - skew * v) / fx
            points[d, j] = undistort(u, v, lens)
            errors[d, j] = sigma[d, j] * zoom
    return points, errors


@njit(cache=True)
def _add_evidence(sums, first, second, spreads, cameras, wrong):
    """Add the log likelihood ratios of all pairs of pieces of two views in one window to ``sums`` (2, A, B).

    The first are those of the keypoints, the second those of keypoints without errors. Detections of each view are
    sorted by frame.
    """
    frames_a, pieces_a, points_a, errors_a = first
    frames_b, pieces_b, points_b, errors_b = second
    essential, rotation, base = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    _relative(cameras[0], cameras[1], rotation, base, essential)
    low = 0
    for a in range(len(frames_a)):
        while low < len(frames_b) and frames_b[low] < frames_a[a]:
            low += 1
        for b in range(low, len(frames_b)):
            if frames_b[b] != frames_a[a]:
                break
            for j in range(points_a.shape[1]):
                x, y = points_a[a, j], points_b[b, j]
                error_a, error_b = errors_a[a, j], errors_b[b, j]
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
                ratio = wrong
                if _in_front(x, y, rotation, base):
                    squared = value * value
                    ratio += (1.0 - wrong) * np.sqrt(chance / noise) * np.exp(-0.5 * squared * (1 / noise - 1 / chance))
                sums[0, pieces_a[a], pieces_b[b]] += np.log(ratio)
                sums[1, pieces_a[a], pieces_b[b]] += np.log(wrong + (1.0 - wrong) * np.sqrt(chance / noise))


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
