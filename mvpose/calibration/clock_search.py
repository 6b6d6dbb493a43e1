"""Coarse search of clock offsets: shifts of whole frames at which the rays of two views meet best.

Every pair of views is compared at every shift; offsets of all cameras follow from the costs of all pairs at once, since
a shift that suits one pair must suit the others as well.
"""

import itertools

import numpy as np

from mvpose.arrays import Floats
from mvpose.calibration.joint_tracks import ImageTracks
from mvpose.camera import Rig

_MOST = 3000  # points of a view that are compared at each shift
_LEAST = 30  # points that two views share, for a pair to count
_ROUNDS = 20
_LARGEST = 1.0  # s: most by which two clocks differ


def coarse_offsets(rig: Rig, tracks: ImageTracks) -> Floats:
    """Return offsets of the clocks, (V,), seconds: whole frames, true time minus given time, some of them 0.

    Two clocks differ by at most a second.
    """
    views = len(rig)
    most = max(1, round(_LARGEST / tracks.period))
    grid = np.nanmedian(tracks.times, axis=1)
    grid = np.arange(grid[0], grid[-1] + 0.5 * tracks.period, tracks.period)
    samples = tracks.sample(np.repeat(grid[:, None], views, axis=1))
    rays = _rays(rig, samples.points)  # (G, V, K, 3)
    every = max(1, int(np.isfinite(rays[..., 0]).sum(axis=(0, 2)).max() // _MOST))
    costs = np.zeros((views, views, 2 * most + 1))  # of b seen `shift` frames later than a
    for a, b in itertools.combinations(range(views), 2):
        curve = _curve(rays[:, a], rays[:, b], rig.centers[b] - rig.centers[a], most, every)
        costs[a, b], costs[b, a] = curve, curve[::-1]
    return tracks.period * _joint_shifts(costs, most)


def _rays(rig: Rig, points: Floats) -> Floats:
    """Return unit viewing directions (G, V, K, 3) of normalised points (G, V, K, 2)."""
    local = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)
    world = np.einsum("vij,gvki->gvkj", np.stack([camera.R for camera in rig]), local)
    return world / np.linalg.norm(world, axis=-1, keepdims=True)


def _curve(a: Floats, b: Floats, baseline: Floats, most: int, every: int) -> Floats:
    """Return the cost of each shift, (2 most + 1,), by how far rays a and b (G, K, 3) pass; 0 if it cannot be known.

    Where b is seen s frames later than a, the ray of a in frame k belongs to that of b in frame k + s.
    """
    normals = np.cross(a, baseline)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    frames = np.arange(0, a.shape[1], every)
    sines = np.full((2 * most + 1, a.shape[0], len(frames)), np.nan)
    for row, shift in enumerate(range(-most, most + 1)):
        inside = (frames + shift >= 0) & (frames + shift < b.shape[1])
        there = b[:, frames[inside] + shift]
        sines[row][:, inside] = (normals[:, frames[inside]] * there).sum(axis=-1)
    distances = np.abs(sines.reshape(2 * most + 1, -1))
    counts = np.isfinite(distances).sum(axis=1)
    if counts.min() < _LEAST:
        return np.zeros(2 * most + 1)
    scale = np.nanmedian(distances, axis=1).min()
    mean = np.nanmean(np.log1p((distances / max(scale, 1e-6)) ** 2), axis=1)
    return counts.max() * mean


def _joint_shifts(costs: Floats, most: int) -> Floats:
    """Return shifts (V,) in frames of least total cost, view by view until none changes, from the best of V starts."""
    best, least = np.zeros(len(costs), int), np.inf
    for start in range(len(costs)):
        shifts = _improved(costs, most, _grown(costs, most, start))
        total = _total(costs, most, shifts)
        if total < least - 1e-9:
            best, least = shifts, total
    return -(best - np.round(np.median(best)))


def _grown(costs: Floats, most: int, start: int) -> Floats:
    """Return shifts that are found one view after the other, beginning at one."""
    shifts, done = np.zeros(len(costs), int), [start]
    while len(done) < len(costs):
        rest = [view for view in range(len(costs)) if view not in done]
        curves = {view: _conditional(costs, most, shifts, view, done) for view in rest}
        view = max(rest, key=lambda each: np.median(curves[each]) - curves[each].min())
        shifts[view] = curves[view].argmin() - most
        done.append(view)
    return shifts


def _improved(costs: Floats, most: int, shifts: Floats) -> Floats:
    for _ in range(_ROUNDS):
        before = shifts.copy()
        for view in range(len(costs)):
            others = [other for other in range(len(costs)) if other != view]
            shifts[view] = _conditional(costs, most, shifts, view, others).argmin() - most
        if (shifts == before).all():
            break
    return shifts


def _conditional(costs: Floats, most: int, shifts: Floats, view: int, others: list[int]) -> Floats:
    """Return the cost of each shift of a view, (2 most + 1,), beside other views with known shifts."""
    total, wanted = np.zeros(2 * most + 1), np.arange(-most, most + 1)
    for other in others:
        index = wanted - shifts[other]
        curve = costs[other, view]
        total += np.where(np.abs(index) <= most, curve[np.clip(index, -most, most) + most], curve.max())
    return total


def _total(costs: Floats, most: int, shifts: Floats) -> float:
    pairs = itertools.combinations(range(len(costs)), 2)
    apart = [(a, b, int(shifts[b] - shifts[a])) for a, b in pairs]
    return float(sum(costs[a, b, s + most] if abs(s) <= most else costs[a, b].max() for a, b, s in apart))
