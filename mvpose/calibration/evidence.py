"""How much evidence repeated sightings are: errors of detectors last, and joints of one body share them.

The variance of a sum of correlated errors is that of independent ones times a design effect (Kish, "Survey Sampling",
1965). Two effects multiply. Along time, the errors of a person's keypoints have a known autocorrelation
:data:`CORRELATION` ``exp(-dt / LIFETIME)``, so that a person seen at times t_1 ... t_n has the effect

    1/n  sum over i, j of  (1 if i = j else CORRELATION exp(-abs(t_i - t_j) / LIFETIME)),

about 11 for 50 frames within ten seconds. A recording of some seconds cannot show this by its own scatter: the
correction of the cameras absorbs errors that last as long as the recording. Within a frame, the effect of shared errors
of joints and of wrong error models is measured: the scatter of the gradients of people in single frames over that of
independent keypoints (a sandwich estimate: White, Econometrica 1982).
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats, Integers

CORRELATION, LIFETIME = 0.87, 1.5
"""Share of the variance of keypoint errors that lasts, and its lifetime, seconds. Autocorrelations measured on
detections of OpenPose are .85 after 0.04 s, .44 after 1 s and .24 after 2 s."""

_PLACE = 0.5  # metres: in a smaller one a person is seen from the same side by all cameras
_UNKNOWN = 2.0  # effect within a frame where there are too few to measure it
_FEWEST = 10  # people in frames from which it is measured


def lasting_effect(times: Floats) -> float:
    """Return the design effect of errors at these times, (n,), seconds, in ascending order."""
    before, pairs = 0.0, 0.0  # sum of correlations of one time with all earlier ones; of all pairs
    for elapsed in np.diff(times):
        before = (before + 1.0) * np.exp(-elapsed / LIFETIME)
        pairs += before
    return 1.0 + 2.0 * CORRELATION * pairs / max(len(times), 1)


def importance_over_time(person: Integers, times: Floats) -> Floats:
    """Return the weight of each of G joints by the design effect of its person, (G,).

    Args:
        person: person of each joint, (G,).
        times: time of each joint, (G,), seconds.
    """
    result = np.ones(len(person))
    for each in np.unique(person):
        own = person == each
        result[own] = 1.0 / lasting_effect(np.unique(times[own]))
    return result


def importance_by_place(
    person: Integers, frame: Integers, kind: Integers, positions: Floats
) -> tuple[Floats, Integers]:
    """Return weights with which all sightings of one joint of a person in one place count as one.

    A detector repeats its errors on a person who does not move, for any length of time.

    Args:
        person: person of each joint, (G,).
        frame: frame of each joint, (G,).
        kind: index of each joint in the skeleton, (G,).
        positions: of the joints, (G, 3), metres; NaN where unknown.

    Returns:
        Weights (G,), and the number of the person in a place, (G,).
    """
    _, body = np.unique(np.stack([person, frame]), axis=1, return_inverse=True)
    order = np.argsort(body.ravel(), kind="stable")
    place = np.zeros((len(person), 3))
    for own in np.split(order, np.flatnonzero(np.diff(body.ravel()[order])) + 1):
        if np.isfinite(positions[own, 0]).any():
            place[own] = np.nanmedian(positions[own], axis=0)
    cell = np.floor(place / _PLACE).astype(np.int64)
    _, group = np.unique(np.column_stack([person, cell]), axis=0, return_inverse=True)
    group = group.ravel().astype(np.int64)
    _, same, count = np.unique(np.stack([group, kind]), axis=1, return_inverse=True, return_counts=True)
    return 1.0 / count[same.ravel()], group


def shared_effect(gradients: Floats, importance: Floats, information: Floats) -> float:
    """Return the design effect of errors that the joints of a body in one frame share, at least 1.

    Args:
        gradients: of half the squared residuals, by person and frame, (n, p).
        importance: weight of each person and frame, (n,), which the gradients contain.
        information: of all independent keypoints, (p, p).
    """
    if len(gradients) < _FEWEST or not information.size:
        return _UNKNOWN
    size = np.sqrt(np.maximum(np.diag(information), 1e-12))
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    seen = values > 1e-6 * values.max()
    projected = (gradients / np.sqrt(importance)[:, None] / size) @ vectors[:, seen]
    return float(max(np.mean((projected**2).sum(axis=0) / values[seen]), 1.0))
