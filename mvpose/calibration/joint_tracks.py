"""Image tracks of joints: keypoints of one joint of one person along time in every view, and their values in between.

Clocks differ by fractions of a frame, so that a track is needed at times between its pictures. A parabola is fitted to
the pictures around each time (local polynomial regression: Fan and Gijbels, "Local Polynomial Modelling and Its
Applications", 1996), over so many of them that its error is the same at a picture and between two. Interpolation of two
neighbours would not do: half-way between them it averages their errors, and views would agree best half a frame apart.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.sightings import Sightings
from mvpose.camera import Camera, Rig
from mvpose.kernels import njit

_BANDWIDTH = 0.3  # s, on each side: most of the swing of a limb (once a second: Winter 2009) is left
_FRAMES = 1.6  # least bandwidth in frames: a neighbour on each side has weight


class TrackSamples(NamedTuple):
    """Tracks at K times."""

    points: Floats
    """Normalised coordinates, (G, V, K, 2); NaN where the track is not known."""
    velocities: Floats
    """Their change, (G, V, K, 2), 1/s."""
    sigma: Floats
    """Standard deviation of the keypoints around, (G, V, K)."""


@dataclass(frozen=True)
class ImageTracks:
    """Tracks of G joints (of a person each) in V views over F frames, in normalised coordinates without distortion."""

    points: Floats
    """x / z and y / z in the camera, (G, V, F, 2); NaN where there is no keypoint."""
    sigma: Floats
    """Standard deviation of a point, (G, V, F)."""
    times: Floats
    """Time of each picture, (F, V), seconds; between its neighbours where no picture was delivered."""
    person: Integers
    """Person of each track, (G,)."""
    joint: Integers
    """Joint of each track, (G,)."""
    period: float
    """Time between frames, seconds."""

    @classmethod
    def of_sightings(cls, rig: Rig, sightings: Sightings, *, without: Bools | None = None) -> Self:
        """Return the tracks of sightings.

        Args:
            rig: the calibrated cameras.
            sightings: keypoints matched over time and views.
            without: pictures that are left out, (F, V).
        """
        frames, views = sightings.times.shape
        sightings = sightings.select(_of_shared_people(sightings))
        names, group = np.unique(np.stack([sightings.person, sightings.joint], axis=1), axis=0, return_inverse=True)
        group = group.reshape(-1)
        points = np.full((len(names), views, frames, 2), np.nan)
        sigma = np.full((len(names), views, frames), np.nan)
        for view, camera in enumerate(rig):
            rows = np.flatnonzero(sightings.view == view)
            where = group[rows], view, sightings.frame[rows]
            points[where] = _normalized(camera, sightings.pixels[rows])
            sigma[where] = sightings.sigma[rows] / np.sqrt(camera.K[0, 0] * camera.K[1, 1])
        if without is not None:
            points[:, without.T] = np.nan
        times = np.stack([_filled(column) for column in sightings.times.T], axis=1)
        steps = np.diff(times, axis=0)
        return cls(points, sigma, times, names[:, 0], names[:, 1], float(np.median(steps)) if steps.size else 0.04)

    def sample(self, at: Floats) -> TrackSamples:
        """Return the tracks of each view at times (K, V), seconds by the clock of the view."""
        bandwidth = max(_BANDWIDTH, _FRAMES * self.period)
        return TrackSamples(*_sample(self.points, self.sigma, self.times, np.ascontiguousarray(at), bandwidth))


def _of_shared_people(sightings: Sightings) -> Bools:
    """Return which sightings, (k,), are of people whom two views or more see."""
    people = int(sightings.person.max(initial=-1)) + 1
    seen = np.zeros((people, sightings.times.shape[1]), np.bool_)
    seen[sightings.person, sightings.view] = True
    return (seen.sum(axis=1) >= 2)[sightings.person]


def _normalized(camera: Camera, pixels: Floats) -> Floats:
    """Return pixels (k, 2) as x / z and y / z in the camera, (k, 2); NaN where the lens images no direction."""
    flat = camera.undistort(pixels)
    return np.asarray(np.linalg.solve(camera.K, np.column_stack([flat, np.ones(len(flat))]).T).T[:, :2], np.float64)


def _filled(times: Floats) -> Floats:
    """Return the times of pictures, (F,), with those that are NaN on the line of the others."""
    known = np.flatnonzero(np.isfinite(times))
    if len(known) == len(times):
        return times
    if len(known) < 2:
        return np.arange(len(times), dtype=float)
    frames = np.arange(len(times))
    slope = (times[known[-1]] - times[known[0]]) / (known[-1] - known[0])
    inside = np.interp(frames, known, times[known])
    before, after = np.minimum(frames - known[0], 0), np.maximum(frames - known[-1], 0)
    return inside + slope * (before + after)


@njit(cache=True)
def _sample(points, sigma, times, at, bandwidth):
    """Fit a parabola to each track around each time; see :meth:`ImageTracks.sample`."""
    tracks, views = sigma.shape[:2]
    values = np.full((tracks, views, len(at), 2), np.nan)
    speeds = np.full((tracks, views, len(at), 2), np.nan)
    scales = np.full((tracks, views, len(at)), np.nan)
    for v in range(views):
        for k in range(len(at)):
            now = at[k, v]
            first = np.searchsorted(times[:, v], now - bandwidth)
            last = np.searchsorted(times[:, v], now + bandwidth)
            for g in range(tracks):
                _parabola(
                    points[g, v, first:last], sigma[g, v, first:last], times[first:last, v], now, bandwidth,
                    values[g, v, k], speeds[g, v, k], scales[g, v, k : k + 1],
                )  # fmt: skip
    return values, speeds, scales


@njit(cache=True)
def _parabola(points, sigma, times, now, bandwidth, value, speed, scale):
    """Fit a parabola to points (n, 2) around a time; set value (2,), speed (2,) and scale (1,) where it is determined.

    Wrong keypoints of single pictures (another joint, another person) lose their weight in rounds (Cauchy weights).
    """
    n = len(points)
    weights = np.zeros(n)
    before, after, count = 0, 0, 0
    total, spread = 0.0, 0.0
    for i in range(n):
        if np.isnan(points[i, 0]):
            continue
        lead = (times[i] - now) / bandwidth
        weights[i] = (1.0 - min(abs(lead), 1.0) ** 3) ** 3
        if weights[i] <= 1e-3:
            weights[i] = 0.0
            continue
        count += 1
        before += lead <= 1e-9
        after += lead >= -1e-9
        total += weights[i]
        spread += weights[i] * sigma[i]
    if count < 3 or before == 0 or after == 0:
        return
    spread /= total
    moments, sides, fit = np.zeros(5), np.zeros((2, 3)), np.zeros((2, 3))
    for turn in range(3):
        moments[:], sides[:] = 0.0, 0.0
        for i in range(n):
            if weights[i] == 0.0:
                continue
            u = (times[i] - now) / bandwidth
            weight = weights[i]
            if turn:
                square = 0.0
                for axis in range(2):
                    square += (points[i, axis] - fit[axis, 0] - u * (fit[axis, 1] + u * fit[axis, 2])) ** 2
                weight /= 1.0 + square / (2.0 * spread) ** 2
            power = weight
            for m in range(5):
                moments[m] += power
                if m < 3:
                    sides[0, m] += power * points[i, 0]
                    sides[1, m] += power * points[i, 1]
                power *= u
        a, b, c, d, e = moments
        determinant = a * (c * e - d * d) - b * (b * e - c * d) + c * (b * d - c * c)
        if not determinant > 1e-6 * a * a * a:
            return
        for axis in range(2):
            p, q, r = sides[axis]
            fit[axis, 0] = ((c * e - d * d) * p + (c * d - b * e) * q + (b * d - c * c) * r) / determinant
            fit[axis, 1] = ((c * d - b * e) * p + (a * e - c * c) * q + (b * c - a * d) * r) / determinant
            fit[axis, 2] = ((b * d - c * c) * p + (b * c - a * d) * q + (a * c - b * b) * r) / determinant
    for axis in range(2):
        value[axis] = fit[axis, 0]
        speed[axis] = fit[axis, 1] / bandwidth
    scale[0] = spread
