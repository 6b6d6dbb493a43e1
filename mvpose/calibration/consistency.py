"""Agreement of pairs of views about the people in them: likelihood of their tracklets, without any reconstruction.

Two keypoints show one joint only if their viewing rays meet in front of both cameras. The distance of the rays in units
of the keypoints' errors (Sampson distance: Hartley & Zisserman, Multiple View Geometry, section 11.4.3) does not depend
on the scale of the rig, so it compares readings of a calibration that differ in their units. Its distribution for one
joint is compared with that for places drawn independently from the two pictures: the logarithm of their ratio is the
evidence for a reading.

Tracklets are matched as a whole over seconds. Single poses of different people often fit by chance, those of two
people who move rarely do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.pieces import Pieces
from mvpose.calibration.ray_evidence import assigned, best_evidence, normalised, window_sums

ViewRays = tuple[Integers, Integers, Integers, Integers, Floats, Floats]
"""Detections of a view: first one of each window (W + 1,), number of pieces in each (W,), and of each its frame (n,),
piece (n,), normalised coordinates (n, J, 2) and their standard deviations (n, J)."""


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

    _MOST_RAYS, _MOST_PAIRS = 64, 4096  # values that are kept; those of a view take a megabyte

    def __init__(self, pieces: Pieces) -> None:
        self.pieces = pieces
        self._rays: dict[tuple[int, bytes], tuple[ViewRays, Floats]] = {}
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
                result[i, j] = best_evidence(*self._views(reading, keys, i, j), True)
        return result

    def agreement(self, reading: Reading) -> Floats:
        """Return the evidence of each camera's pairs as a share of what it would be at best, (V,)."""
        evidence, ideal = (each.sum(axis=2) for each in (self(reading), self.ideal(reading)))
        evidence, ideal = (each + each.T for each in (evidence, ideal))
        return evidence.sum(axis=1) / np.maximum(ideal.sum(axis=1), 1e-9)

    def pairs(self, reading: Reading) -> Iterator[tuple[int, int, int, Integers]]:
        """Yield view, view, window and the matched pieces (n, 2) under a reading."""
        keys = [_key(reading, view) for view in range(len(reading.cameras))]
        for i in range(len(keys)):
            for j in range(i + 1, len(keys)):
                views = self._views(reading, keys, i, j)
                for w in range(self.pieces.windows):
                    yield i, j, w, assigned(window_sums(*views, w, False))

    def rays(self, reading: Reading, view: int) -> Floats:
        """Return the viewing rays of a view's detections in the world, (n, J, 3), of depth 1; NaN where missing."""
        points = self._view_rays(reading, _key(reading, view), view)[0][4]
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
