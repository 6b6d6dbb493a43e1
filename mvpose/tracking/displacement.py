"""How far a track has moved since its birth: people do sooner or later, and what hangs on a wall never does.

A false detection that lasts (a poster, a coat on a stand) is fixed in its picture, and so is the place where two of
them meet by chance. The displacement is that of the body as a whole, the mean over the joints that are known both
times. It counts only while two cameras see the track: where one does, or none, the place is partly a guess.
"""

from __future__ import annotations

import numpy as np

from mvpose.kernels import njit

_TOGETHER = 0.1  # seconds: two cameras have seen a track at about the same time


@njit(cache=True)
def note_displacement(anchor, moved, state, found, now):
    """Update the largest displacement (n,) of tracks from their anchors, metres, in place.

    Args:
        anchor: place of each joint when it was first known, (n, J, 3), metres; NaN before. Updated in place.
        moved: largest displacement so far, (n,), metres.
        state: positions and velocities, (n, J, 6).
        found: time at which each camera last found a track, (n, V), seconds.
        now: seconds.
    """
    mean = np.empty(3)
    for t in range(len(state)):
        recent = 0
        for v in range(found.shape[1]):
            recent += found[t, v] >= now - _TOGETHER
        if recent < 2:
            continue
        count = 0
        mean[:] = 0.0
        for j in range(state.shape[1]):
            if np.isnan(state[t, j, 0]):
                continue
            if np.isnan(anchor[t, j, 0]):
                for r in range(3):
                    anchor[t, j, r] = state[t, j, r] - (mean[r] / count if count else 0.0)
            else:
                count += 1
                for r in range(3):
                    mean[r] += state[t, j, r] - anchor[t, j, r]
        if count:
            square = 0.0
            for r in range(3):
                square += (mean[r] / count) ** 2
            moved[t] = max(moved[t], np.sqrt(square))


@njit(cache=True, borrows=True)
def staying(moved, spread, mobile):
    """Return the likelihood that something which is fixed in its pictures seems to have moved this far.

    Args:
        moved: metres.
        spread: standard deviation of its place, metres.
        mobile: share of lasting false detections that do move: shadows, reflections.
    """
    return max(np.exp(-0.5 * (moved / spread) ** 2), mobile)
