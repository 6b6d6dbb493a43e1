"""Robust bundle adjustment of cameras over matched people, with a prior on the believed calibration.

The data do not fix the place, the orientation and the size of the whole rig; the prior does. It has heavy tails (a
Student distribution for each camera): where most cameras agree with each other, they keep their places, and one that
was moved takes the whole correction, as in a least sum of distances; where all cameras are off, the correction is
spread over them as by least squares.

A detector repeats its errors as long as it sees a person from the same side, and the joints of a person share errors,
so the evidence is less than the number of sightings says. All sightings of a joint in one place count as one. What is
left is the design effect (Kish 1965): the ratio of the variance of the gradients of clusters (a person in a place) to
that of independent sightings. It divides the evidence before it meets the prior, and so enters the covariance as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.bundle import (
    CENTER,
    CLOCK,
    FOCAL,
    PARAMETERS,
    ROTATION,
    TRANSLATION,
    Observations,
    Reduced,
    changed,
    difference,
    observations,
    reduce,
)
from mvpose.calibration.sightings import Sightings
from mvpose.camera import Rig

_FREEDOM = 4.0  # of the Student distribution of each camera's error
_PLACE = 0.5  # metres: in a smaller one a person is seen from the same side by all cameras
_LEAST_EFFECT = 5.0  # errors that all people share in a view; measured on 12 simulated recordings of 10 s
_ROUNDS = 5
_STEPS = 6
_CONVERGED = 0.01  # of a standard deviation
_LARGEST_SCALE = 3.0
_WIDE = 10.0  # spread of the errors of cameras in the first round: 2 degrees, 0.1 m
_SCALE_STEPS = 20
_SETTLED = 0.1  # relative change of the spread of errors of cameras


@dataclass(frozen=True)
class Prior:
    """Errors of a careful calibration: standard deviations of the body of the distribution, whose tails are heavy.

    Rotations and positions after calibration with a board are off by 0.2 degrees and 5 to 19 mm, focal lengths by 0.3
    to 1.3 % (caliscope).

    Attributes:
        rotation: radians.
        translation: metres.
        clock: seconds.
        focal: relative.
        center: pixels.
    """

    rotation: float = float(np.radians(0.2))
    translation: float = 0.02
    clock: float = 0.01
    focal: float = 0.005
    center: float = 5.0

    def sigmas(self) -> Floats:
        """Return the standard deviation of each parameter of a camera, (10,)."""
        result = np.empty(PARAMETERS)
        result[ROTATION], result[TRANSLATION], result[CLOCK] = self.rotation, self.translation, self.clock
        result[FOCAL], result[CENTER] = self.focal, self.center
        return result


_GROUPS = (slice(0, 6), CLOCK, FOCAL, CENTER)  # parameters that are off together


@dataclass(frozen=True)
class Adjustment:
    """Result of a bundle adjustment.

    Attributes:
        rig: adjusted cameras.
        parameters: changes of the believed cameras, (V, 10); see :mod:`mvpose.calibration.bundle`.
        covariance: of the parameters, (10 V, 10 V); 0 for those that were held.
        information: of the data alone, per independent sighting, (10 V, 10 V).
        design_effect: number of sightings that are worth one independent sighting.
        observations: the sightings used.
        residuals: of the sightings used, in believed standard deviations, (k, 2).
        weights: probability that each of them is right, (k,).
        points: joints, (p, 3), metres.
        converged: whether the last step was small.
    """

    rig: Rig
    parameters: Floats
    covariance: Floats
    information: Floats
    design_effect: float
    observations: Observations
    residuals: Floats
    weights: Floats
    points: Floats
    converged: bool


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
        free: parameters that may change, (V, 10).
        prior: plausible errors of the believed cameras.
        start: cameras from which the search starts.
        offsets: of the clocks from which the search starts, (V,), seconds.
    """
    prior = prior or Prior()
    seen = observations(rig, sightings)
    seen, clusters = _by_place(rig if start is None else start, sightings, seen)
    sigmas = np.tile(prior.sigmas(), len(rig))
    loose = np.flatnonzero(free.ravel())
    parameters = np.zeros((len(rig), PARAMETERS))
    if start is not None:
        parameters = np.stack([difference(a, b) for a, b in zip(rig, start, strict=True)])
    if offsets is not None:
        parameters[:, CLOCK] = np.asarray(offsets)[:, None]
    parameters[~free] = 0.0
    believed_scale, factor, effect = seen.scale, np.ones(len(sightings.skeleton)), 5.0
    converged, spread = False, np.full(len(_GROUPS), np.inf)
    reduced = _reduced(rig, parameters, seen, clusters, None)
    for turn in range(_ROUNDS):
        factor = _joint_scales(seen, reduced, factor)
        seen = replace(seen, scale=believed_scale / factor[seen.joint])
        reduced = _reduced(rig, parameters, seen, clusters, reduced.points)
        damping = 1e-6
        for _ in range(_STEPS):
            effect = _design_effect(reduced, loose)
            before, spread = spread, _spread(parameters, sigmas, free, start_wide=not turn)
            weight = _prior_weights(parameters, sigmas, free, spread)
            step, converged = _step(reduced, parameters, weight, effect, loose, damping)
            proposed = (parameters.ravel() + step).reshape(parameters.shape)
            trial = _reduced(rig, proposed, seen, clusters, reduced.points)
            better = (
                trial.cost / effect + _penalty(proposed, sigmas, free, spread)
                <= reduced.cost / effect + _penalty(parameters, sigmas, free, spread) + 1e-9
            )
            if better or converged:
                parameters, reduced, damping = proposed, trial, 0.1 * damping
            else:
                damping = max(100.0 * damping, 1e-3)
            converged = converged and bool((np.abs(spread / before - 1.0) < _SETTLED).all())
            if converged:
                break
    weight = _prior_weights(parameters, sigmas, free, spread)
    effect = _design_effect(reduced, loose)
    covariance = np.zeros_like(reduced.information)
    matrix = reduced.information / effect + np.diag(weight)
    covariance[np.ix_(loose, loose)] = np.linalg.inv(matrix[np.ix_(loose, loose)])
    return Adjustment(
        _rig(rig, parameters),
        parameters,
        covariance,
        reduced.information / effect,
        effect,
        seen,
        reduced.residuals * factor[seen.joint][:, None],
        reduced.weights,
        reduced.points,
        converged,
    )


def _rig(rig: Rig, parameters: Floats) -> Rig:
    return Rig([changed(camera, each) for camera, each in zip(rig, parameters, strict=True)])


def _reduced(rig: Rig, parameters: Floats, seen: Observations, clusters: Integers, points: Floats | None) -> Reduced:
    return reduce(_rig(rig, parameters), parameters[:, CLOCK].ravel(), seen, clusters=clusters, points=points)


def _by_place(rig: Rig, sightings: Sightings, seen: Observations) -> tuple[Observations, Integers]:
    """Return the sightings with the importance of each point, and the cluster of each point, (p,).

    A detector makes the same errors with somebody who stays where he is: all sightings of one joint of a person in one
    place count as one. The person in a place is the cluster.
    """
    first = seen.row[seen.start[:-1]]
    if not len(first):
        return seen, np.zeros(0, np.int64)
    points = reduce(rig, np.zeros(len(rig)), seen).points
    person, frame, joint = sightings.person[first], sightings.frame[first], sightings.joint[first]
    _, body = np.unique(np.stack([person, frame]), axis=1, return_inverse=True)
    order = np.argsort(body.ravel(), kind="stable")
    place = np.empty((len(first), 3))
    for each in np.split(order, np.flatnonzero(np.diff(body.ravel()[order])) + 1):
        place[each] = np.median(points[each], axis=0)
    cell = np.floor(place / _PLACE).astype(np.int64)
    _, clusters = np.unique(np.column_stack([person, cell]), axis=0, return_inverse=True)
    clusters = clusters.ravel()
    _, same, count = np.unique(np.stack([clusters, joint]), axis=1, return_inverse=True, return_counts=True)
    return replace(seen, importance=1.0 / count[same.ravel()]), clusters.astype(np.int64)[seen.point]


def _joint_scales(seen: Observations, reduced: Reduced, factor: Floats) -> Floats:
    """Return how much larger the errors of each joint are than believed, (J,).

    A point of m sightings leaves 2 m - 3 of the 2 m numbers free to show errors.
    """
    square = (reduced.residuals**2).sum(axis=1) * factor[seen.joint] ** 2
    sound = np.bincount(seen.point, reduced.weights, minlength=len(seen.start) - 1)[seen.point]
    free = reduced.weights * np.clip(2.0 - 3.0 / np.maximum(sound, 1e-6), 0.0, 2.0)
    count = len(factor)
    total = np.bincount(seen.joint, reduced.weights * square * (free > 0), minlength=count)
    freedom = np.bincount(seen.joint, free, minlength=count)
    # Ten sightings of the believed size keep joints that are hardly seen at their size.
    return np.clip(np.sqrt((total + 10.0) / (freedom + 10.0)), 1.0 / _LARGEST_SCALE, _LARGEST_SCALE)


def _design_effect(reduced: Reduced, loose: Integers) -> float:
    """Return the variance of the gradients of clusters over that of independent sightings, at least 1."""
    gradients = reduced.gradients[:, loose]
    clusters = len(gradients)
    if clusters < 2 or not len(loose):
        return 20.0
    gradients = gradients - gradients.mean(axis=0)
    values, vectors = np.linalg.eigh(reduced.information[np.ix_(loose, loose)] / np.outer(*2 * [_size(reduced, loose)]))
    seen = values > 1e-6 * values.max()
    projected = (gradients / _size(reduced, loose)) @ vectors[:, seen]
    ratio = (projected**2).sum(axis=0) / values[seen] * clusters / (clusters - 1)
    return float(max(np.mean(ratio), _LEAST_EFFECT))


def _size(reduced: Reduced, loose: Integers) -> Floats:
    """Return scales that give the information a diagonal of ones."""
    return np.sqrt(np.maximum(np.diag(reduced.information)[loose], 1e-12))


def _squares(parameters: Floats, sigmas: Floats, free: Bools, group: slice) -> tuple[Integers, Floats]:
    """Return for each camera the number of free parameters of a group, and their squared standardised sum, (V,)."""
    scaled = parameters[:, group] / sigmas.reshape(parameters.shape)[:, group]
    return free[:, group].sum(axis=1), (scaled**2 * free[:, group]).sum(axis=1)


def _spread(parameters: Floats, sigmas: Floats, free: Bools, *, start_wide: bool) -> Floats:
    """Return how much wider than that of a careful calibration the distribution of each group of errors is, at least 1.

    This is the scale of a Student distribution, by expectation maximisation. It starts wide, where all cameras share
    the correction: so a single camera that moved is found to be an outlier, and of cameras that are all off none is
    taken to be right.
    """
    result = np.ones(len(_GROUPS))
    for number, group in enumerate(_GROUPS):
        size, square = _squares(parameters, sigmas, free, group)
        if not (size > 0).all() or group in (FOCAL, CENTER):
            continue  # no freedom of the whole rig, so that nothing has to be shared
        if start_wide:
            result[number] = _WIDE
            continue
        whole_rig = 1 if group == CLOCK else 7  # numbers of a similarity, which follows the cameras
        variance = max(float(square.max(initial=0.0)), 1.0)
        for _ in range(_SCALE_STEPS):
            weight = (_FREEDOM + size) / (_FREEDOM + square / variance)
            variance = max(float((weight * square).sum() / max(size.sum() - whole_rig, 1)), 1.0)
        result[number] = np.sqrt(variance)
    return result


def _prior_weights(parameters: Floats, sigmas: Floats, free: Bools, spread: Floats) -> Floats:
    """Return the information of the prior on each parameter, reweighted by the errors found, (10 V,)."""
    weight = np.ones_like(parameters)
    for number, group in enumerate(_GROUPS):
        size, square = _squares(parameters, sigmas, free, group)
        weight[:, group] = ((_FREEDOM + size) / (_FREEDOM * spread[number] ** 2 + square))[:, None]
    return weight.ravel() / sigmas**2


def _penalty(parameters: Floats, sigmas: Floats, free: Bools, spread: Floats) -> float:
    """Return minus the logarithm of the prior."""
    total = 0.0
    for number, group in enumerate(_GROUPS):
        size, square = _squares(parameters, sigmas, free, group)
        total += float((0.5 * (_FREEDOM + size) * np.log1p(square / (_FREEDOM * spread[number] ** 2))).sum())
    return total


def _step(
    reduced: Reduced, parameters: Floats, weight: Floats, effect: float, loose: Integers, damping: float
) -> tuple[Floats, bool]:
    """Return a damped Gauss-Newton step, (10 V,), and whether it is small against the standard deviations."""
    matrix = (reduced.information / effect + np.diag(weight))[np.ix_(loose, loose)]
    right = (reduced.gradients.sum(axis=0) / effect + weight * parameters.ravel())[loose]
    result = np.zeros(parameters.size)
    if not len(loose):
        return result, True
    diagonal = np.sqrt(np.diag(matrix))
    scaled = matrix / np.outer(diagonal, diagonal)
    step = -np.linalg.solve(scaled + damping * np.eye(len(loose)), right / diagonal)
    result[loose] = step / diagonal
    return result, bool(np.abs(step).max() < _CONVERGED * max(len(loose), 1) ** 0.5)
