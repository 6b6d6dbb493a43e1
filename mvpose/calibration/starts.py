"""Starts of cameras that began to record at different moments, seconds apart, from people who move.

Where the times of two cameras are shifted against each other by the right amount, viewing rays of the same people meet
at every moment; at any other shift they meet here and there, because people come back to where they were. So the
evidence of :mod:`.consistency`, of people matched over two seconds, is taken at every shift of each pair of cameras, as
a share of what it would be if all rays met. How often a share occurs at all shifts, nearly all of them wrong, is the
distribution of chance: of people who stand still, or step on the spot, it has high shares as well. The sum over windows
of the logarithm of the ratio of both likelihoods, right against chance, is the evidence for a shift.

Shifts of all cameras at once have the most evidence of all pairs (:func:`.clocks.joint_shifts`), so that they agree
around any loop of cameras. They are an answer where every group of cameras is tied to the others by more evidence than
chance gives at the best of many shifts, and no other shift fits as well where it can be compared: people who walk in
circles repeat themselves.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.clocks import joint_shifts
from mvpose.calibration.consistency import WRONG, ViewRays, evidence_and_most, normalised
from mvpose.calibration.findings import camera_names
from mvpose.calibration.sufficiency import RECORD
from mvpose.calibration.tracklets import Tracklets, link
from mvpose.camera import Rig
from mvpose.detections import Detections

LARGEST = 10.0
"""Largest difference of two starts that is looked for, seconds."""

_STEP = 0.08  # s between shifts that are compared, or a frame of the fastest camera: people walk 10 cm in it
_WINDOW = 2.0  # s over which people are matched as a whole, as in :mod:`.pieces`
_SPACING = 0.24  # s between poses that are compared: errors of detectors last longer
_TOLERANCE = 0.015  # of normalised coordinates: errors of the calibration, and of half a step
_LEAST_MOST = 30.0  # nats that a window could give at best, below which it is left out: a person in a few poses
_BINS = 20  # of shares
_POWER = 10.0  # of the density of shares at the right shift: simulated recordings have 14, cameras off by 0.5 degrees 7
_CHANCE = 6.0  # nats from a pair; pairs see the same moments, so of n pairs times root n (best of other people: 3)
_REPEAT = 1 / 3  # of the most evidence, which another shift needs to be its rival: people repeat less by chance
_RIVAL = 1.0  # nats by which a rival must fit worse, window for window
_PEAK = 0.4  # s around the best shift that are the same answer: half a step of a person who walks
_GROUP = 3  # most cameras of a group that may be apart from the others


class _Poses(NamedTuple):
    """Poses of one view in the order of rows of a time grid."""

    row: Integers
    """Row of each pose, (n,)."""
    tracklet: Integers
    """Tracklet, (n,)."""
    points: Floats
    """Normalised coordinates, (n, J, 2)."""
    errors: Floats
    """Their standard deviations, (n, J)."""
    spread: Floats
    """Covariance of all coordinates, (2, 2)."""

    def select(self, which: Bools | slice) -> "_Poses":
        """Return some poses."""
        row, tracklet, points, errors, spread = self
        return _Poses(row[which], tracklet[which], points[which], errors[which], spread)


def find_starts(rig: Rig, frames: Sequence[Detections], *, period: float = 0.04) -> Floats:
    """Return when cameras began to record, from people who move in front of several of them.

    Args:
        rig: the calibrated cameras; directions may be off by half a degree.
        frames: detections of each frame, of a minute at most, or it takes minutes as well; the times of a camera's
            pictures are by its clock, which starts anywhere.
        period: seconds between frames whose detections carry no time.

    Returns:
        True time minus given time of each camera, (V,), seconds, against the first one; to half a frame or so.

    Raises:
        ValueError: the recording does not determine the starts; the message names the cameras.
    """
    names = camera_names(rig)
    if len(rig) < 2:
        raise ValueError("one camera alone has no start to be found: give the detections of two cameras or more")
    tracklets = link(rig, frames, period=period)
    blind = [name for view, name in enumerate(names) if not (tracklets.view == view).any()]
    if blind:
        raise ValueError(f"cannot tell when camera {', '.join(blind)} began to record: it sees nobody; {RECORD}")
    curves, step = _curves(rig, tracklets)
    shifts = _best_shifts(curves, step)
    doubtful = _doubtful(curves, shifts, step)
    if doubtful:
        raise ValueError(
            f"cannot tell when camera {', '.join(names[view] for view in doubtful)} began to record: people move too "
            "little, or always alike, or the recordings share too short a time, or show different people, or the "
            f"calibration is wrong; {RECORD}"
        )
    return step * (shifts - shifts[0])


def _curves(rig: Rig, tracklets: Tracklets) -> tuple[Floats, float]:
    """Return curves of each pair of views over shifts of the second, (3, V, V, S), and the step, s.

    The curves are the evidence against chance, nats; the number of windows; and what evidence of poses falls short by.
    """
    step = max(_STEP, float(np.nanmin(np.nanmedian(np.diff(tracklets.times, axis=0), axis=0))))
    most, window, every = round(LARGEST / step), round(_WINDOW / step), max(1, round(_SPACING / step))
    shifts = range(-most, most + 1)
    views = [_poses(rig, tracklets, view, step) for view in range(len(rig))]
    rows = np.concatenate([each.row for each in views])
    first, windows = int(rows.min()), int(np.ptp(rows)) // window + 1
    placed = [[_placed(each, first - shift, window, windows) for shift in shifts] for each in views[1:]]
    # Beyond, two views say nothing about each other, as without a window in common; others may tie both.
    curves = np.zeros((3, len(rig), len(rig), 4 * most + 1))
    for a, b in combinations(range(len(rig)), 2):
        sparse = views[a].select(views[a].row % every == 0)
        one, spreads = _placed(sparse, first, window, windows), np.stack([views[a].spread, views[b].spread])
        pair = spreads, rig.packed[[a, b]]
        found = np.array([evidence_and_most(one, other, *pair) for other in placed[b - 1]])  # (S, W, 2)
        curves[:, a, b, most:-most] = against_chance(found[..., 0], found[..., 1])
        curves[:, b, a] = curves[:, a, b, ::-1]
    return curves, step


def against_chance(evidence: Floats, most: Floats) -> Floats:
    """Return the three curves of :func:`_curves`, (3, S), of one pair, given the evidence of windows, (S, W)."""
    counted = most > _LEAST_MOST
    bins = np.minimum(_BINS * evidence / np.maximum(most, _LEAST_MOST), _BINS - 1).astype(np.int64)
    chance = np.bincount(bins[counted], minlength=_BINS) + 2.0 / _BINS
    right = np.diff(np.linspace(0.0, 1.0, _BINS + 1) ** (_POWER + 1.0))
    ratio = np.log((1.0 - WRONG) * right * chance.sum() / chance + WRONG)[bins]
    return np.stack([np.where(counted, ratio, 0.0), counted, most - evidence]).sum(axis=-1)


def _about(curves: Floats, shifts: Integers) -> Floats:
    """Return curves (..., V, V, S) with each pair's shift in the middle; 0 for shifts that were not looked at."""
    most = curves.shape[-1] // 2
    index = np.arange(-most, most + 1) + (shifts - shifts[:, None])[..., None]
    moved = np.take_along_axis(curves, np.broadcast_to(np.clip(index, -most, most) + most, curves.shape), axis=-1)
    return np.where(np.abs(index) <= most, moved, 0.0)


def _best_shifts(curves: Floats, step: float) -> Integers:
    """Return the shifts of views, (V,), with the most evidence, and near it those at which poses fall least short."""
    near, most = round(_PEAK / step), curves.shape[-1] // 2
    shifts = joint_shifts(-curves[0])
    return shifts + joint_shifts(_about(curves[2], shifts)[..., most - near : most + near + 1])


def _doubtful(curves: Floats, shifts: Integers, step: float) -> list[int]:
    """Return the views that may be elsewhere, alone or with some others."""
    evidence, windows = _about(curves[:2], shifts)
    views, most = len(shifts), evidence.shape[-1] // 2
    moves = np.arange(-most, most + 1)
    doubtful: set[int] = set()
    for size in range(1, min(_GROUP, views // 2) + 1):
        for group in map(np.array, combinations(range(views), size)):
            others = np.setdiff1d(np.arange(views), group)
            found, count = (each[np.ix_(others, group)].sum(axis=(0, 1)) for each in (evidence, windows))
            best, chance = found[np.abs(moves) <= _PEAK / step].max(), _CHANCE * np.sqrt(len(others) * len(group))
            moved = shifts[group][:, None, None] + moves - shifts[others][:, None]
            rivals = (np.abs(moves) > _PEAK / step) & (np.abs(moved) <= LARGEST / step).all(axis=(0, 1))
            rivals &= found > max(chance, _REPEAT * best)
            behind = best / max(count[most], 1.0) * count[rivals] - found[rivals]
            if best < chance or behind.min(initial=np.inf) < _RIVAL:
                doubtful.update(group.tolist())
    return sorted(doubtful)


def _poses(rig: Rig, tracklets: Tracklets, view: int, step: float) -> _Poses:
    """Return the poses of a view, for each tracklet those nearest to the rows of a grid of times."""
    own = np.flatnonzero(tracklets.view == view)
    keypoints, sigma = (np.ascontiguousarray(each[own]) for each in (tracklets.keypoints, tracklets.sigma))
    points, errors, spread = normalised(keypoints, sigma, rig.packed[view], np.eye(2, 3))
    at, tracklet = tracklets.times[tracklets.frame[own], view] / step, tracklets.tracklet[own]
    row = np.round(at).astype(np.int64)
    order = np.lexsort((np.abs(at - row), tracklet, row))
    _, nearest = np.unique(np.stack([row[order], tracklet[order]]), axis=1, return_index=True)
    chosen = order[nearest]
    return _Poses(row[chosen], tracklet[chosen], points[chosen], np.hypot(errors[chosen], _TOLERANCE), spread)


def _placed(poses: _Poses, first: int, window: int, windows: int) -> ViewRays:
    """Return the poses by windows of so many rows, of which the first one begins at a row."""
    row = poses.row - first
    bounds = np.searchsorted(row, window * np.arange(windows + 1))
    inside = slice(bounds[0], bounds[-1])
    row, tracklet, bounds = row[inside], poses.tracklet[inside], bounds - bounds[0]
    number = row // window
    pieces, piece = np.unique(np.stack([number, tracklet]), axis=1, return_inverse=True)
    starts = np.searchsorted(pieces[0], np.arange(windows + 1))
    return bounds, np.diff(starts), row, piece.ravel() - starts[number], poses.points[inside], poses.errors[inside]
