"""Starts of cameras that began to record at different moments, seconds apart, from people who move.

Where the times of two cameras are shifted against each other by the right amount, viewing rays of the same people meet
at every moment; at any other shift they meet here and there, because people come back to where they were. So the
evidence of :mod:`.consistency`, of people matched over two seconds, is taken at every shift of each pair of cameras, as
a share of what it would be if all rays met. It does not grow with the time that two recordings share: movements that
repeat would else be found where they overlap most.

Groups of cameras are joined where the share of all their pairs is clearest, beginning with single cameras. How far the
best shift is ahead of all others tells whether the recording determines it: people who stand still agree at any shift.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.consistency import ViewRays, evidence_and_most, normalised
from mvpose.calibration.findings import camera_names
from mvpose.calibration.sufficiency import RECORD
from mvpose.calibration.tracklets import Tracklets, link
from mvpose.camera import Rig
from mvpose.detections import Detections

LARGEST = 10.0
"""Largest difference of two starts that is looked for, seconds."""

_STEP = 0.04  # s between shifts that are compared, or a frame of the fastest camera: people walk 5 cm in it
_WINDOW = 2.0  # s over which people are matched as a whole, as in :mod:`.pieces`
_SPACING = 0.24  # s between poses that are compared: errors of detectors last longer
_LONGEST = 30.0  # s of a recording that are looked at
_TOLERANCE = 0.01  # of normalised coordinates: errors of the calibration, and of half a step
_SHORTEST = 0.1  # of the greatest overlap, below which a shift is not looked at
_DOUBT = 4.0  # standard deviation of a share, times the root of the evidence in nats: few poses agree by chance
_PEAK = 0.4  # s around the best shift that are the same answer: half a step of a person who walks
_LEAST_AGREEMENT = 0.8  # of two groups at the best shift: .88 and more for right ones of simulated cameras
_USUAL = 0.1  # of how far the best shift is ahead of the median one, as a margin: people who stand still have no other
_LEAST_MARGIN = 0.012
"""Least margin of a result: wrong ones of simulated recordings (one person, or steps on the spot that repeat) have .006
at most."""


@dataclass(frozen=True)
class Starts:
    """Starts of V cameras."""

    offsets: Floats
    """True time minus given time of each camera, (V,), seconds, against the first one; to a frame."""
    margins: Floats
    """How far the offset of each camera is ahead of any other one, (V,): difference of the shares of evidence."""


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


def find_starts(rig: Rig, frames: Sequence[Detections], *, period: float = 0.04) -> Starts:
    """Return when cameras began to record, from people who move in front of several of them.

    Args:
        rig: the calibrated cameras; directions may be off by a degree.
        frames: detections of each frame; the times of a camera's pictures are by its clock, which starts anywhere.
        period: seconds between frames whose detections carry no time.

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
    found = _joined(*_curves(rig, tracklets))
    if found.margins.min() < _LEAST_MARGIN:
        doubtful = ", ".join([names[view] for view in np.flatnonzero(found.margins < _LEAST_MARGIN)])
        raise ValueError(
            f"cannot tell when camera {doubtful} began to record: people move too little, or always alike, or the "
            f"recordings share too short a time; {RECORD}"
        )
    return found


def _curves(rig: Rig, tracklets: Tracklets) -> tuple[Floats, Floats, float]:
    """Return the evidence of each pair of views at each shift of the second, its most, (V, V, S), and the step, s."""
    delivered = [column[np.isfinite(column)] for column in tracklets.times.T]
    step = max(_STEP, min(float(np.median(np.diff(each))) for each in delivered if len(each) > 1))
    most, window, every = round(LARGEST / step), round(_WINDOW / step), max(1, round(_SPACING / step))
    shifts = np.arange(-most, most + 1)
    views = [_poses(rig, tracklets, view, step) for view in range(len(rig))]
    first = _busiest(np.concatenate([each.row for each in views]), round(_LONGEST / step))
    windows = round(_LONGEST / _WINDOW)
    evidence, ideal = np.zeros((2, len(rig), len(rig), len(shifts)))
    placed = [[_placed(each, first - shift, window, windows) for shift in shifts.tolist()] for each in views[1:]]
    for a, b in combinations(range(len(rig)), 2):
        sparse = views[a].select(views[a].row % every == 0)
        one, spreads = _placed(sparse, first, window, windows), np.stack([views[a].spread, views[b].spread])
        pair = spreads, rig.packed[[a, b]]
        found = np.array([evidence_and_most(one, other, *pair) for other in placed[b - 1]])
        evidence[a, b], ideal[a, b] = found.T
        evidence[b, a], ideal[b, a] = evidence[a, b, ::-1], ideal[a, b, ::-1]
    return evidence, ideal, step


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


def _busiest(rows: Integers, length: int) -> int:
    """Return the first of so many rows that hold most poses."""
    total = np.cumsum(np.append(0, np.bincount(rows - rows.min())))
    return int(rows.min()) + (int((total[length:] - total[:-length]).argmax()) if len(total) > length else 0)


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


def _joined(evidence: Floats, ideal: Floats, step: float) -> Starts:
    """Return offsets of views, joined by groups, given the curves of all pairs."""
    views = len(evidence)
    groups, margins = [{view: 0} for view in range(views)], np.full(views, np.inf)
    while len(groups) > 1:
        joints = {pair: _best(evidence, ideal, groups[pair[0]], groups[pair[1]], step) for pair in _pairs(groups)}
        (one, other), (margin, shift) = max(joints.items(), key=lambda each: each[1][0])
        smaller = min(groups[one], groups[other], key=len)
        margins[list(smaller)] = np.minimum(margins[list(smaller)], margin)
        groups[one] |= {view: at + shift for view, at in groups.pop(other).items()}
    shifts = np.array([groups[0][view] for view in range(views)])
    return Starts(step * (shifts - shifts[0]), margins)


def _pairs(groups: Sequence[dict[int, int]]) -> list[tuple[int, int]]:
    return list(combinations(range(len(groups)), 2))


def _best(
    evidence: Floats, ideal: Floats, one: dict[int, int], other: dict[int, int], step: float
) -> tuple[float, int]:
    """Return the best shift of a group of views with known shifts, and its margin."""
    most = evidence.shape[2] // 2
    shifts = np.arange(-most, most + 1)
    total, whole = np.zeros((2, len(shifts)))
    for (a, before), (b, after) in product(one.items(), other.items()):
        index = shifts + after - before
        inside = np.abs(index) <= most
        total[inside] += evidence[a, b, index[inside] + most]
        whole[inside] += ideal[a, b, index[inside] + most]
    known = np.maximum(whole, 1.0)
    share = np.where(whole >= _SHORTEST * whole.max(), total / known - _DOUBT / np.sqrt(known), -np.inf)
    best = int(share.argmax())
    if total[best] < _LEAST_AGREEMENT * whole[best]:
        return 0.0, int(shifts[best])
    rest = share[np.abs(shifts - shifts[best]) > _PEAK / step]
    usual = np.median(share[np.isfinite(share)])
    return float(min(share[best] - rest.max(), _USUAL * (share[best] - usual))), int(shifts[best])
