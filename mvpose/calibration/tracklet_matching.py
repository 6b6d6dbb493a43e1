"""Matching of tracklets between views over seconds, tolerant to a wrong rig.

The lines of sight of one joint in two views pass each other at a signed distance that is linear in small errors of the
two cameras: a shift, a rotation, and an offset of the clock (seven numbers for each camera). So the distances of a pair
of tracklets over many frames and joints are a linear regression on 14 unknowns with a prior, the uncertainty of the
rig: tracklets of one person fit it up to the errors of keypoints, those of different people do not, however far the
cameras are off, as soon as people move or differ in pose. The score of a pair is the logarithm of its marginal
likelihood, against that of two different people. Where detections carry descriptors, appearance counts as well
(:func:`evidence_of_looks`).

People are the groups of tracklets with the greatest sum of scores (correlation clustering, as in
:mod:`mvpose.matching.clustering`), with no two tracklets of one view at one time. The pairs in groups then give the
errors of the cameras; the uncertainty of the rig shrinks, and the pairs are scored again. Their evidence counts little
at first, so that early mistakes can be corrected.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.affinity.appearance import AppearanceAffinity
from mvpose.arrays import Bools, Floats, Integers
from mvpose.calibration.tracklets import Tracklets, chosen_frames, frame_times
from mvpose.camera import Camera, Rig
from mvpose.kernels import njit
from mvpose.matching.clustering import join_by_gains

UNKNOWNS = 7
"""Numbers for each camera: rotation vector about its centre (world axes, rad), shift of the centre (m), clock (s)."""

_SPACING = 0.2  # seconds between the frames that are compared
_INDEPENDENT = 0.2  # share of the keypoints whose errors are independent: errors last, and joints share them
_WRONG = 0.1  # share of the keypoints of the right person that are grossly wrong
_ELSEWHERE = 2.5  # metres: the lines of sight of two different people pass each other at any distance within it
_LEAST_GAIN = 0.5  # of the logarithm of the likelihood, for each keypoint: how much likelier one person must be
_LEAST_SINE = 0.05  # lines of sight closer to parallel are no evidence
_NEAREST = 0.5  # metres: a nearer body does not fit in the picture
_LEAST_SAMPLES = 12  # joints in frames that two tracklets must share
_TEMPERING = (0.1, 0.3, 1.0, 1.0, 1.0, 1.0)  # weight of the evidence about the rig in each round
_ROOT = float(np.sqrt(2.0 * np.pi))
_SCALE = 0.001  # relative uncertainty of the size of the whole rig, which is not to be estimated
_STEP = 0.02  # seconds, for the derivative of a line of sight by time


@dataclass(frozen=True)
class RigUncertainty:
    """Standard deviations of the errors of each camera along each axis."""

    rotation: float
    """Radians."""
    translation: float
    """Metres."""
    clock: float = 0.0
    """Seconds."""

    def information(self, views: int) -> Floats:
        """Return the inverse covariance of all unknowns, (7 V, 7 V)."""
        sigmas = [self.rotation] * 3 + [self.translation] * 3 + [max(self.clock, 1e-4)]
        return np.diag(np.tile(1.0 / np.square(sigmas), views))


@dataclass(frozen=True)
class PeopleGroups:
    """Groups of tracklets, each of one person."""

    person: Integers
    """Person of each tracklet, (tracklets,); people of one view have numbers of their own."""
    score: float
    """Sum of the scores of all pairs in groups, to compare matchings of the same tracklets."""
    rig: Rig
    """The rig with the corrections that were found on the way."""


def corrected(camera: Camera, rotation: Floats, shift: Floats) -> Camera:
    """Return a camera turned about its centre by a rotation vector (world axes, rad), with a shifted centre (m)."""
    R = camera.R @ Rotation.from_rotvec(rotation).as_matrix().T
    return replace(camera, R=R, t=-R @ (camera.center + shift))


def match_tracklets(rig: Rig, tracklets: Tracklets, uncertainty: RigUncertainty) -> PeopleGroups:
    """Group the tracklets of all views into people.

    Args:
        rig: believed cameras.
        tracklets: from :func:`mvpose.calibration.tracklets.link`.
        uncertainty: plausible errors of the rig.
    """
    views = len(rig)
    frames = chosen_frames(tracklets, spacing=_SPACING)
    rows = np.flatnonzero(frames[tracklets.frame])
    apart, pairs = _candidates(tracklets, rows)
    count = len(tracklets)
    prior = uncertainty.information(views) + _known_scale(rig)
    total, groups, score = np.zeros(UNKNOWNS * views), np.arange(count), 0.0
    information = prior
    clocks = np.zeros(views)
    if not len(pairs):
        return PeopleGroups(groups, 0.0, rig)
    looks = evidence_of_looks(tracklets, apart)[pairs[:, 0], pairs[:, 1]]
    starts = np.searchsorted(tracklets.tracklet[rows], np.arange(count + 1))
    adjusted = rig
    for weight in _TEMPERING:
        sights = _lines_of_sight(adjusted, tracklets, rows, clocks)
        covariance = np.linalg.inv(information)
        gains, left, right = _score_pairs(
            pairs, starts, tracklets.frame[rows], tracklets.view[rows], adjusted.centers, *sights, covariance
        )
        gains = np.where(gains != 0.0, gains + looks, 0.0)  # looks alone do not join
        matrix = np.where(apart, -np.inf, 0.0)
        matrix[pairs[:, 0], pairs[:, 1]] = matrix[pairs[:, 1], pairs[:, 0]] = gains
        before, groups = groups, join_by_gains(matrix)
        inside = groups[pairs[:, 0]] == groups[pairs[:, 1]]
        # Gauss-Newton step: corrections since the believed rig have the prior of the believed rig.
        lhs, rhs = prior.copy(), -prior @ total
        for pair in np.flatnonzero(inside):
            a, b = tracklets.views[pairs[pair]]
            index = np.concatenate([np.arange(UNKNOWNS) + UNKNOWNS * a, np.arange(UNKNOWNS) + UNKNOWNS * b])
            lhs[np.ix_(index, index)] += weight * left[pair]
            rhs[index] += weight * right[pair]
        step: Floats = np.linalg.solve(lhs, rhs).astype(np.float64)
        total, information = total + step, lhs
        # Marginal likelihood: what the freedom of the rig and the correction cost is taken off.
        freedom = np.linalg.slogdet(lhs)[1] - np.linalg.slogdet(prior)[1]
        score = float(gains[inside].sum() - 0.5 * (total @ prior @ total + freedom))
        if weight == 1.0 and (before == groups).all() and step @ lhs @ step < len(step):
            break
        corrections = step.reshape(views, UNKNOWNS)
        clocks = clocks + corrections[:, 6]
        adjusted = Rig([corrected(c, each[:3], each[3:6]) for c, each in zip(adjusted, corrections, strict=True)])
    _, person = np.unique(groups, return_inverse=True)
    return PeopleGroups(person, score, adjusted)


def _known_scale(rig: Rig) -> Floats:
    """Return the information that the size of the whole rig is right, (7 V, 7 V).

    Distances between lines of sight shrink with the rig, so that a fit of distances would make it ever smaller.
    """
    arms = rig.centers - rig.centers.mean(axis=0)
    direction = np.zeros((len(rig), UNKNOWNS))
    direction[:, 3:6] = arms / (arms**2).sum()
    return np.outer(direction, direction) / _SCALE**2


def _candidates(tracklets: Tracklets, rows: Integers) -> tuple[Bools, Integers]:
    """Return which tracklets cannot show one person, (n, n), and the pairs of different views to compare, (p, 2)."""
    count, frames = len(tracklets), len(tracklets.times)
    present = np.zeros((count, frames), np.float32)
    present[tracklets.tracklet, tracklets.frame] = 1.0
    same_view = tracklets.views[:, None] == tracklets.views[None]
    apart = same_view & (present @ present.T > 0)
    present[:] = 0.0
    present[tracklets.tracklet[rows], tracklets.frame[rows]] = 1.0
    together = np.triu((present @ present.T > 0) & ~same_view)
    np.fill_diagonal(apart, True)
    return apart, np.argwhere(together)


def _lines_of_sight(rig: Rig, tracklets: Tracklets, rows: Integers, clocks: Floats) -> tuple[Floats, Floats, Floats]:
    """Return directions (n, J, 3), their derivatives by time, and the angle of one standard deviation (n, J), rad.

    Pictures of one frame that were taken at different times are compared at the median of these times.
    """
    view, frame = tracklets.view[rows], tracklets.frame[rows]
    late = tracklets.times[frame, view] + clocks[view] - frame_times(tracklets.times)[frame]
    velocity = tracklets.velocity[rows]
    pixels = tracklets.keypoints[rows] - velocity * late[:, None, None]
    directions, change = np.zeros((*pixels.shape[:2], 3)), np.zeros((*pixels.shape[:2], 3))
    angle = np.full(pixels.shape[:2], np.inf)
    for number, camera in enumerate(rig):
        own = view == number
        directions[own] = camera.rays(pixels[own])
        # The clock is later by dt: the joint was at this pixel dt later, so that it is seen where it was before.
        change[own] = (camera.rays(pixels[own] - velocity[own] * _STEP) - directions[own]) / _STEP
        angle[own] = tracklets.sigma[rows][own] / np.sqrt(camera.K[0, 0] * camera.K[1, 1])
    bad = ~(np.isfinite(directions).all(axis=-1) & np.isfinite(change).all(axis=-1) & np.isfinite(angle))
    angle[bad] = np.inf
    return directions, change, angle


@njit(cache=True)
def _score_pairs(pairs, starts, frame, view, centers, directions, change, angle, covariance):
    """Score pairs of tracklets.

    Args:
        pairs: tracklets, (p, 2).
        starts: first row of each tracklet.
        frame: frame of each row, (n,), increasing within a tracklet.
        view: view of each row, (n,).
        centers: optical centres, (V, 3), metres.
        directions: lines of sight, (n, J, 3).
        change: their derivatives by the offset of the clock, (n, J, 3).
        angle: standard deviations, rad, (n, J); infinite where there is no keypoint.
        covariance: of the errors of the cameras, (7 V, 7 V).

    Returns:
        Scores (p,), normal matrices (p, 14, 14) and right-hand sides (p, 14) of the errors of the two cameras.
    """
    count, joints, size = len(pairs), directions.shape[1], 2 * UNKNOWNS
    gains = np.zeros(count)
    left, right = np.zeros((count, size, size)), np.zeros((count, size))
    longest = 0
    for p in range(count):
        longest = max(longest, starts[pairs[p, 0] + 1] - starts[pairs[p, 0]])
    error, sigma = np.empty(longest * joints), np.empty(longest * joints)
    jacobian = np.empty((longest * joints, size))
    index = np.empty(size, np.int64)
    for p in range(count):
        a, end_a = starts[pairs[p, 0]], starts[pairs[p, 0] + 1]
        b, end_b = starts[pairs[p, 1]], starts[pairs[p, 1] + 1]
        va, vb = view[a], view[b]
        n, behind = 0, 0
        while a < end_a and b < end_b:
            if frame[a] < frame[b]:
                a += 1
            elif frame[b] < frame[a]:
                b += 1
            else:
                for j in range(joints):
                    if angle[a, j] < np.inf and angle[b, j] < np.inf:
                        one = centers[va], directions[a, j], change[a, j], angle[a, j]
                        other = centers[vb], directions[b, j], change[b, j], angle[b, j]
                        kind = _regressor(one, other, error, sigma, jacobian, n)
                        if kind == 1:
                            n += 1
                        elif kind == 2:
                            behind += 1
                a += 1
                b += 1
        if n + behind < _LEAST_SAMPLES:
            continue
        for k in range(UNKNOWNS):
            index[k], index[UNKNOWNS + k] = UNKNOWNS * va + k, UNKNOWNS * vb + k
        prior = np.empty((size, size))
        for r in range(size):
            for c in range(size):
                prior[r, c] = covariance[index[r], index[c]]
        gains[p] = _fit(error[:n], sigma[:n], jacobian[:n], np.linalg.inv(prior), left[p], right[p])
        gains[p] += _INDEPENDENT * behind * np.log(_WRONG)
    return gains, left, right


@njit(cache=True)
def _regressor(one, other, error, sigma, jacobian, row):
    """Write the signed distance of two lines of sight, its standard deviation and its derivatives into a row.

    A line of sight is its origin (3,), its direction (3,), the derivative of this by the offset of the clock (3,) and
    its standard deviation, rad.

    Returns:
        1; 0 where the lines are nearly parallel, and 2 where they meet behind a camera: then nothing is written.
    """
    ca, u, du, angle_a = one
    cb, v, dv, angle_b = other
    nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    sine = np.sqrt(nx * nx + ny * ny + nz * nz)
    if sine < _LEAST_SINE:
        return 0
    nx, ny, nz = nx / sine, ny / sine, nz / sine
    wx, wy, wz = ca[0] - cb[0], ca[1] - cb[1], ca[2] - cb[2]
    cosine = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    wu, wv = wx * u[0] + wy * u[1] + wz * u[2], wx * v[0] + wy * v[1] + wz * v[2]
    s, t = (wv * cosine - wu) / (sine * sine), (wv - wu * cosine) / (sine * sine)
    if s < _NEAREST or t < _NEAREST:
        return 2
    error[row] = wx * nx + wy * ny + wz * nz
    sigma[row] = np.sqrt((s * angle_a) ** 2 + (t * angle_b) ** 2)
    # The closest points move with the cameras; along the lines the distance does not change.
    jacobian[row, 0] = s * (u[1] * nz - u[2] * ny)
    jacobian[row, 1] = s * (u[2] * nx - u[0] * nz)
    jacobian[row, 2] = s * (u[0] * ny - u[1] * nx)
    jacobian[row, 3], jacobian[row, 4], jacobian[row, 5] = nx, ny, nz
    jacobian[row, 6] = s * (du[0] * nx + du[1] * ny + du[2] * nz)
    jacobian[row, 7] = -t * (v[1] * nz - v[2] * ny)
    jacobian[row, 8] = -t * (v[2] * nx - v[0] * nz)
    jacobian[row, 9] = -t * (v[0] * ny - v[1] * nx)
    jacobian[row, 10], jacobian[row, 11], jacobian[row, 12] = -nx, -ny, -nz
    jacobian[row, 13] = -t * (dv[0] * nx + dv[1] * ny + dv[2] * nz)
    return 1


@njit(cache=True)
def _fit(error, sigma, jacobian, prior, left, right):
    """Fit ``error + jacobian @ x`` with outliers by expectation maximisation; return the score of the pair.

    Writes the normal matrix and the right-hand side of x without the prior into ``left`` and ``right``.

    Args:
        error: signed distances, (n,), metres.
        sigma: standard deviations, (n,), metres.
        jacobian: (n, 14).
        prior: inverse covariance of x, (14, 14).
        left: normal matrix, (14, 14), overwritten.
        right: right-hand side, (14,), overwritten.
    """
    n, size = jacobian.shape
    x = np.zeros(size)
    gain = 0.0
    for step in range(6):
        wide = 3.0 if step == 0 else 2.0 if step == 1 else 1.0  # so that the fit starts from all samples
        left[:], right[:] = 0.0, 0.0
        gain = 0.0
        for k in range(n):
            r = error[k]
            for c in range(size):
                r += jacobian[k, c] * x[c]
            narrow = wide * sigma[k]
            likelier = _ELSEWHERE / (_ROOT * narrow) * np.exp(-0.5 * (r / narrow) ** 2)
            sound = (1.0 - _WRONG) * likelier / ((1.0 - _WRONG) * likelier + _WRONG)
            gain += np.log((1.0 - _WRONG) * likelier + _WRONG) - _LEAST_GAIN
            weight = _INDEPENDENT * sound / (sigma[k] * sigma[k])
            for c in range(size):
                right[c] -= weight * jacobian[k, c] * error[k]
                for d in range(c + 1):
                    left[c, d] += weight * jacobian[k, c] * jacobian[k, d]
        for c in range(size):
            for d in range(c):
                left[d, c] = left[c, d]
        if step < 5:
            x = np.linalg.solve(left + prior, right)
    gain *= _INDEPENDENT
    gain -= 0.5 * (x @ prior @ x)
    return gain - 0.5 * (np.linalg.slogdet(left + prior)[1] - np.linalg.slogdet(prior)[1])


def mean_looks(tracklets: Tracklets) -> tuple[Floats, Bools]:
    """Return the mean unit descriptor of each tracklet, (tracklets, D), and whether it has one, (tracklets,)."""
    count = len(tracklets)
    descriptors = tracklets.descriptors
    if descriptors is None or not descriptors.shape[1]:
        return np.zeros((count, 0)), np.zeros(count, np.bool_)
    length = np.linalg.norm(descriptors, axis=1)
    described = np.isfinite(length) & (length > 0.0)
    unit = descriptors[described] / length[described, None]
    total, number = np.zeros((count, descriptors.shape[1])), np.bincount(tracklets.tracklet[described], minlength=count)
    np.add.at(total, tracklets.tracklet[described], unit)
    return total / np.maximum(number, 1)[:, None], number > 0


def evidence_of_looks(tracklets: Tracklets, apart: Bools) -> Floats:
    """Return the log-likelihood ratio that two tracklets show one person or two, (n, n); 0 without descriptors.

    As in tracking (:func:`mvpose.tracking.reappearance.evidence_of_looks`), looks speak for one person by as much as
    they are more alike than those of people who are known to be others: in one uniform they are no evidence. They speak
    against it where they are farther apart than those of one person.

    Args:
        tracklets: tracklets of all views.
        apart: which tracklets are known to show different people, or to be the same one, (n, n).
    """
    scale = AppearanceAffinity()
    looks, described = mean_looks(tracklets)
    if not described.any():
        return np.zeros(apart.shape)
    distance = np.sqrt(np.maximum(2.0 - 2.0 * looks @ looks.T, 0.0))
    other = apart & ~np.eye(len(apart), dtype=bool) & described
    rival = np.full(apart.shape, scale.midpoint)
    for each in np.flatnonzero(other.any(axis=1)):  # somebody else, seen beside this one
        rival[:, each] = np.minimum(rival[:, each], distance[:, other[each]].min(axis=1))
    rival = np.minimum(rival, rival.T)
    nats = np.maximum(rival - distance, 0.0) - np.maximum(distance - scale.midpoint, 0.0)
    return np.where(described[:, None] & described, nats / scale.slope, 0.0)
