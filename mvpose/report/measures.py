"""Numbers of a recording without truth: what is off in which picture, what joints rest on, whether people are rigid."""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.recording import People
from mvpose.report.reprojection import Reprojection

_LIMBS = (
    ("upper arm", "shoulder", "elbow"),
    ("forearm", "elbow", "wrist"),
    ("thigh", "hip", "knee"),
    ("shin", "knee", "ankle"),
)
_ACROSS = (("shoulders", "left_shoulder", "right_shoulder"), ("hips", "left_hip", "right_hip"))
_LEAST_LENGTHS = 5  # of a bone, to say anything about their spread
_GAUSSIAN_SPREAD = 0.7413  # standard deviations of a Gaussian in its interquartile range


def median_by(values: Floats, *keys: tuple[Integers, int]) -> Floats:
    """Return the median of values in each cell of a table; NaN in a cell without any.

    Args:
        values: (k,).
        keys: for each axis of the table the index of each value, (k,), and the length of the axis.
    """
    table = np.full(tuple(length for _, length in keys), np.nan)
    cells = np.ravel_multi_index(tuple(index for index, _ in keys), table.shape)
    order = np.argsort(cells, kind="stable")
    held, first = np.unique(cells[order], return_index=True)
    table.ravel()[held] = [np.median(part) for part in np.split(values[order], first[1:])] if len(held) else []
    return table


def supporting_views(reprojection: Reprojection, people: People) -> Integers:
    """Return the number of views that support each joint, (F, n, J), of the frames of the reprojection; -1 if absent.

    A view supports a joint with a keypoint that the error model takes for right.
    """
    present = people.present[reprojection.frames]
    count = np.zeros(present.shape, np.int64)
    row = np.searchsorted(reprojection.frames, reprojection.frame)
    here = reprojection.supports
    np.add.at(count, (row[here], reprojection.person[here], reprojection.joint[here]), 1)
    return np.where(present, count, -1)


def views_of_people(reprojection: Reprojection, people: People) -> Integers:
    """Return the number of views with a detection of each person, (F, n); -1 where the person is absent."""
    present = people.present[reprojection.frames].any(axis=2)
    seen = np.zeros((*present.shape, int(reprojection.view.max(initial=-1)) + 1), bool)
    seen[np.searchsorted(reprojection.frames, reprojection.frame), reprojection.person, reprojection.view] = True
    return np.where(present, seen.sum(axis=2), -1)


def share_on_one_view(supports: Integers) -> float:
    """Return the share of estimated joints that at most one view supports; NaN without any.

    One view determines a direction only. Such a joint's distance comes from bone lengths, or from earlier frames.

    Args:
        supports: of :func:`supporting_views`.
    """
    estimated = supports >= 0
    return float((supports[estimated] <= 1).mean()) if estimated.any() else np.nan


@dataclass(frozen=True)
class Bone:
    """Lengths of one bone of one person over time."""

    name: str
    """Name of the bone."""
    person: int
    """Row in ``People``."""
    length: float
    """Median length, of both sides where there are two, metres."""
    spread: float
    """Standard deviation over time, from the interquartile range, metres; the mean of both sides."""
    asymmetry: float
    """Difference of left and right over their mean; NaN for a bone without sides."""


def bones(people: People) -> list[Bone]:
    """Return the rigid bones of each person, by person.

    The real bone has one length, and nearly the same on both sides: people differ by 1 to 2 % between left and right
    (Auerbach & Ruff, Journal of Human Evolution 2006). What is more is error.
    """
    found = []
    for person in range(len(people)):
        for name, start, end in _LIMBS:
            sides = [_lengths(people, person, f"{side}_{start}", f"{side}_{end}") for side in ("left", "right")]
            known = [side for side in sides if len(side) >= _LEAST_LENGTHS]
            if known:
                medians = [float(np.median(side)) for side in known]
                mean = float(np.mean(medians))
                differs = abs(medians[0] - medians[1]) / mean if len(medians) == 2 else np.nan
                found.append(Bone(name, person, mean, float(np.mean([_spread(side) for side in known])), differs))
        for name, start, end in _ACROSS:
            lengths = _lengths(people, person, start, end)
            if len(lengths) >= _LEAST_LENGTHS:
                found.append(Bone(name, person, float(np.median(lengths)), _spread(lengths), np.nan))
    return found


def _lengths(people: People, person: int, start: str, end: str) -> Floats:
    """Return the lengths of a bone in the frames that have both ends, (k,), metres."""
    if not {start, end} <= set(people.skeleton.joints):
        return np.zeros(0)
    ends = people.joints[:, person, [people.skeleton.index(start), people.skeleton.index(end)]]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=-1)
    return lengths[lengths > 0]


def _spread(lengths: Floats) -> float:
    low, high = np.quantile(lengths, [0.25, 0.75])
    return _GAUSSIAN_SPREAD * float(high - low)
