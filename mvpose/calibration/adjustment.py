"""Robust bundle adjustment of cameras over matched people, with a prior on the believed calibration.

For given cameras each joint is solved for (:mod:`.normal_equations`), so that the cameras are the only state (variable
projection: Golub & Pereyra 1973). Steps are those of Levenberg and Marquardt, with the evidence of the sightings as
independent ones and the prior (:mod:`.calibration_prior`).

The covariance is that of the posterior, ``(information / effect + prior)⁻¹``: the information of independent keypoints,
divided by the design effects of errors that last and of errors that joints share, so that it is the covariance of the
estimate with correlated errors as long as these have no preferred direction.

The variance of a sum of correlated errors is that of independent ones times a design effect (Kish, "Survey Sampling",
1965). Two effects multiply. Along time, the errors of a person's keypoints have a known autocorrelation
:data:`CORRELATION` ``exp(-dt / LIFETIME)``, so that a person seen at times t_1 ... t_n has the effect

    1/n  sum over i, j of  (1 if i = j else CORRELATION exp(-abs(t_i - t_j) / LIFETIME)),

about 11 for 50 frames within ten seconds. A recording of some seconds cannot show this by its own scatter: the
correction of the cameras absorbs errors that last as long as the recording. Within a frame, the effect of shared errors
of joints and of wrong error models is measured: the scatter of the gradients of people in single frames over that of
independent keypoints (a sandwich estimate: White, Econometrica 1982).
"""

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.calibration_prior import Prior, PriorWeights
from mvpose.calibration.normal_equations import (
    CLOCK,
    JointViews,
    NormalEquations,
    changed,
    difference,
    normal_equations,
    with_errors,
)
from mvpose.calibration.sightings import Sightings
from mvpose.calibration.tracklets import frame_times
from mvpose.camera import Rig

_STEPS = 40
_CONVERGED = 0.01  # of a standard deviation
_SETTLED = 0.01  # relative change of the prior's width
_START_DAMPING = 1e-6
_STEPS_OF_A_SCALE = 5  # steps after which the size of errors is estimated again

CORRELATION, LIFETIME = 0.87, 1.5
"""Share of the variance of keypoint errors that lasts, and its lifetime, seconds. Autocorrelations measured on
detections of OpenPose are .85 after 0.04 s, .44 after 1 s and .24 after 2 s."""

_PLACE = 0.5  # metres: in a smaller one a person is seen from the same side by all cameras
_UNKNOWN = 2.0  # effect within a frame where there are too few to measure it
_FEWEST = 10  # people in frames from which it is measured


@dataclass(frozen=True)
class Adjustment:
    """Result of a bundle adjustment."""

    rig: Rig
    """Adjusted cameras."""
    parameters: Floats
    """Changes of the believed cameras, (V, 11); see :mod:`mvpose.calibration.normal_equations`."""
    covariance: Floats
    """Of the parameters, (11 V, 11 V); 0 for those that were held."""
    joints: JointViews
    """The sightings used."""
    rows: Integers
    """Row of each of them in the sightings that were given, (k,)."""
    equations: NormalEquations
    """Normal equations at the solution."""
    converged: bool
    """Whether the last step was small."""


def adjust(
    rig: Rig,
    sightings: Sightings,
    *,
    free: Bools,
    prior: Prior | None = None,
    start: Rig | None = None,
    offsets: Floats | None = None,
) -> Adjustment:
    """Adjust cameras to sightings.

    Args:
        rig: believed cameras.
        sightings: of people who are matched.
        free: parameters that may change, (V, 11).
        prior: plausible errors of the believed cameras.
        start: cameras from which the search starts.
        offsets: of the clocks from which the search starts, (V,), seconds.
    """
    prior, shape = prior or Prior(), free.shape
    joints, rows = shared_joints(sightings)
    loose = np.flatnonzero(free.ravel())
    parameters = np.zeros(shape)
    if start is not None:
        parameters = np.stack([difference(a, b) for a, b in zip(rig, start, strict=True)])
    if offsets is not None:
        parameters[:, CLOCK] = np.asarray(offsets)[:, None]
    parameters[~free] = 0.0
    equations = _solved(rig, parameters, joints)
    weights, damping, converged = PriorWeights.wide(prior, len(rig)), _START_DAMPING, False
    for turn in range(_STEPS):
        if turn % _STEPS_OF_A_SCALE == 0:
            equations = _solved(rig, parameters, joints, equations.joints)
        information, effect = _information(equations, joints, loose)
        variances = np.diag(_covariance(information, weights, loose)).reshape(shape)
        before, weights = weights, weights.updated(prior, parameters, variances, free)
        step, small = _step(equations, information, effect, parameters, weights, loose, damping)
        proposed = parameters + step.reshape(shape)
        trial = _solved(rig, proposed, joints, equations.joints, scale=equations.scale)
        better = trial.cost / effect + weights.cost(proposed) <= equations.cost / effect + weights.cost(parameters)
        if better or small:
            parameters, equations, damping = proposed, trial, max(0.1 * damping, _START_DAMPING)
        else:
            damping = max(100.0 * damping, 1e-3)
        settled = small and bool((np.abs(weights.width / before.width - 1.0) < _SETTLED).all())
        if settled:
            latest = _solved(rig, parameters, joints, equations.joints)
            converged = abs(latest.scale / equations.scale - 1.0) < _SETTLED
            equations = latest
            if converged:
                break
    information, _ = _information(equations, joints, loose)
    variances = np.diag(_covariance(information, weights, loose)).reshape(shape)
    covariance = _covariance(information, weights.widened(variances, free), loose)
    adjusted = Rig([changed(camera, each) for camera, each in zip(rig, parameters, strict=True)])
    return Adjustment(adjusted, parameters, covariance, joints, rows, equations, converged)


def shared_joints(sightings: Sightings) -> tuple[JointViews, Integers]:
    """Return the joints that two or more views see, moved to the times of the frames, and the rows of their sightings.

    The clusters are people in frames; evidence is weighted by how long errors last.

    Returns:
        Joints in one block of time, and the row of each of their k sightings among those given, (k,).
    """
    index, _ = sightings.points
    rows = np.flatnonzero(sightings.shared)
    rows = rows[np.lexsort((sightings.view[rows], index[rows]))]
    _, first = np.unique(index[rows], return_index=True)
    reference = frame_times(sightings.times)
    frame, view, velocity = sightings.frame[rows], sightings.view[rows], sightings.velocity
    assert velocity is not None
    late = sightings.times[frame, view] - reference[frame]
    person, when = sightings.person[rows[first]], sightings.frame[rows[first]]
    _, cluster = np.unique(np.stack([person, when]), axis=1, return_inverse=True)
    joints = JointViews(
        start=np.append(first, len(rows)).astype(np.int64),
        block=np.zeros(len(first), np.int64),
        person=person,
        view=view,
        pixels=sightings.pixels[rows] - velocity[rows] * late[:, None],
        sigma=sightings.sigma[rows],
        velocity=velocity[rows],
        blocks=1,
        cluster=cluster.ravel().astype(np.int64),
        importance=importance_over_time(person, reference[when]),
    )
    return joints, rows


def _solved(
    rig: Rig, parameters: Floats, joints: JointViews, first: Floats | None = None, *, scale: float = 0.0
) -> NormalEquations:
    """Return the normal equations at changed cameras; see :func:`normal_equations` for the other arguments."""
    return normal_equations(with_errors(rig.packed, parameters.ravel()), joints, scale=scale, joints=first)


def _information(equations: NormalEquations, joints: JointViews, loose: Integers) -> tuple[Floats, float]:
    """Return the information of independent sightings, (11 V, 11 V), and the design effect of shared errors."""
    assert joints.cluster is not None
    assert joints.importance is not None
    importance = np.ones(len(equations.g))
    importance[joints.cluster] = joints.importance  # the same for all joints of a person
    information = equations.H.sum(axis=0)
    effect = shared_effect(equations.g[:, loose], importance, information[np.ix_(loose, loose)])
    return information / effect, effect


def _covariance(information: Floats, weights: PriorWeights, loose: Integers) -> Floats:
    """Return the covariance of all parameters, (11 V, 11 V); 0 for those that are held."""
    result = np.zeros_like(information)
    matrix = information + np.diag(weights.information.ravel())
    result[np.ix_(loose, loose)] = np.linalg.inv(matrix[np.ix_(loose, loose)])
    return result


def _step(
    equations: NormalEquations,
    information: Floats,
    effect: float,
    parameters: Floats,
    weights: PriorWeights,
    loose: Integers,
    damping: float,
) -> tuple[Floats, bool]:
    """Return a damped Gauss-Newton step, (11 V,), and whether it is small against the standard deviations."""
    prior, result = weights.information.ravel(), np.zeros(parameters.size)
    if not len(loose):
        return result, True
    matrix = (information + np.diag(prior))[np.ix_(loose, loose)]
    right = (equations.g.sum(axis=0) / effect + prior * parameters.ravel())[loose]
    diagonal = np.sqrt(np.diag(matrix))
    step = -np.linalg.solve(matrix / np.outer(diagonal, diagonal) + damping * np.eye(len(loose)), right / diagonal)
    result[loose] = step / diagonal
    return result, bool(np.abs(step).max() < _CONVERGED * len(loose) ** 0.5)


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
