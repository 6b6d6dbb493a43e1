"""Wrong matches: a person whose keypoints in one view are those of another person, and fit much worse than the rest.

A camera that moved misplaces all people alike. One wrong tracklet among right ones would be taken for a camera that
moved, because it misplaces its person in all frames.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.normal_equations import PARAMETERS, JointViews, normal_equations, with_errors
from mvpose.calibration.sightings import Sightings

_TIMES = 3.0  # as far off as the best quarter of the people in that view
_SIGMAS = 4.0  # standard deviations of a keypoint; farther is not noise
_FEWEST = 20  # sightings of a person in a view


def without_mismatches(cameras: Floats, sightings: Sightings, joints: JointViews, rows: Integers) -> Sightings:
    """Return the sightings without those of a person in a view who was matched wrongly there.

    Args:
        cameras: packed cameras, (V, 22).
        sightings: all sightings.
        joints: joints of them that several views see.
        rows: rows of the sightings of ``joints``, (k,).
    """
    views, count = len(cameras), int(sightings.person.max(initial=-1)) + 1
    equations = normal_equations(with_errors(cameras, np.zeros((joints.blocks, PARAMETERS * views))), joints)
    distance = np.linalg.norm(equations.residuals, axis=1) / (equations.scale * joints.sigma)
    cell = sightings.person[rows] * views + joints.view
    off = np.full(count * views, np.nan)
    known = np.isfinite(distance)
    order = np.argsort(cell[known], kind="stable")
    sorted_cells, sorted_distances = cell[known][order], distance[known][order]
    used, start = np.unique(sorted_cells, return_index=True)
    for each, part in zip(used, np.split(sorted_distances, start[1:]), strict=True):
        if len(part) >= _FEWEST:
            off[each] = np.median(part)
    wrong = _much_farther(off.reshape(count, views))
    return sightings.select(~wrong[sightings.person, sightings.view])


def _much_farther(off: Floats) -> Bools:
    """Return the people (n, V) who are much farther off than the others in a view; NaN is unknown."""
    wrong = np.zeros(off.shape, np.bool_)
    for view in range(off.shape[1]):
        known = np.isfinite(off[:, view])
        if known.sum() > 1:
            usual = np.quantile(off[known, view], 0.25, method="lower")
            wrong[known, view] = off[known, view] > max(_TIMES * usual, _SIGMAS)
    return wrong
