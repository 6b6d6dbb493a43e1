"""Joints that several views see, in blocks of time: the input of the camera fit."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Integers
from mvpose.calibration.normal_equations import JointViews
from mvpose.calibration.sightings import Sightings

_SPACING = 0.1  # seconds between frames that are used
_BLOCK = 0.5  # seconds: blocks of time; errors of detectors last less
_MOST_BLOCKS = 48  # of a long recording, whose blocks are longer


def joint_views(sightings: Sightings) -> tuple[JointViews, Integers]:
    """Return the joints seen by two views or more, in frames 0.1 s apart, and the sightings' rows.

    Returns:
        The joints by blocks of time, and the row of each of their sightings among those given, (k,).
    """
    when = np.full(len(sightings.times), np.nan)
    pictures = np.isfinite(sightings.times).any(axis=1)
    when[pictures] = np.nanmedian(sightings.times[pictures], axis=1)
    slot = np.where(pictures, np.floor((when - when[pictures].min(initial=np.inf)) / _SPACING + 1e-9), -1)
    chosen = np.zeros(len(when), np.bool_)
    chosen[np.unique(slot, return_index=True)[1]] = True
    chosen &= pictures
    rows = np.flatnonzero(chosen[sightings.frame] & sightings.shared)
    joints, people = len(sightings.skeleton), int(sightings.person.max(initial=0)) + 1
    key = (sightings.frame[rows] * people + sightings.person[rows]) * joints + sightings.joint[rows]
    order = np.argsort(key, kind="stable")
    rows, key = rows[order], key[order]
    start = np.flatnonzero(np.diff(key, prepend=-1))
    times = when[sightings.frame[rows[start]]]
    length = max(_BLOCK, float(np.ptp(times)) / _MOST_BLOCKS) if len(times) else _BLOCK
    used, number = np.unique(np.floor((times - times.min(initial=np.inf)) / length + 1e-9), return_inverse=True)
    velocity = sightings.velocity
    assert velocity is not None
    views = JointViews(
        np.append(start, len(rows)).astype(np.int64),
        number.astype(np.int64),
        sightings.person[rows[start]],
        sightings.view[rows],
        np.ascontiguousarray(sightings.pixels[rows]),
        sightings.sigma[rows],
        np.ascontiguousarray(velocity[rows]),
        max(len(used), 1),
    )
    return views, rows
