"""Update of the joints of tracked people by the viewing rays of new detections.

Every keypoint corrects its joint across its ray, so that a joint which one camera sees keeps its depth from the past.
Two kinds of evidence meet in the normal equations of a joint: the rays, with the error model of
:mod:`mvpose.reconstruction.likelihood`, and the prediction, as a multivariate t distribution, because people sometimes
move as no model expects. The maximum of their product is found from two starts, the prediction and the point on which
the rays agree.

Where the stages of a frame place a whole body (3DPS, with the lengths and directions of its bones), the pose of a
person whom several cameras saw at once is the evidence instead of the rays, except for joints that fewer than two of
them saw.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.likelihood import accumulate, log_likelihood, solve
from mvpose.reconstruction.poses import Poses
from mvpose.reconstruction.triangulation import Triangulation, consensus
from mvpose.skeleton import Skeleton
from mvpose.tracking.motion import carry, condition, transition, trunk_velocity

_FREEDOM = 4.0  # degrees of freedom of the prediction's t distribution, a common choice for heavy tails
_STEPS = 8
_CONVERGED = 1e-6  # m²
_UNKNOWN = 1.0  # m²: variance of a joint that is seen for the first time, before it is


class MatchedRays(NamedTuple):
    """Viewing rays of the m detections of a frame, as kernels take them, with the groups of the matching."""

    labels: Integers
    """Group of each detection, (m,), or -1."""
    view: Integers
    """Camera of each, (m,)."""
    origins: Floats
    """Optical centres, (m, 3), metres."""
    directions: Floats
    """Unit vectors, (m, J, 3)."""
    weights: Floats
    """Scores, (m, J); 0 for a missing keypoint."""
    pixel: Floats
    """Least angle of an error, (m,), radians."""
    lead: Floats
    """Time from the frame to the picture of each, (m,), seconds."""


class PlacedPeople(NamedTuple):
    """Poses of k of n tracked people, as the stages of one frame place them."""

    of_pose: Integers
    """Row of each track in the poses, (n,); -1 for a track whose rays are the evidence."""
    places: Floats
    """Joints, (k, J, 3), metres; NaN for an unknown joint."""
    spreads: Floats
    """Their covariances, (k, J, 3, 3)."""
    confidences: Floats
    """Their scores, (k, J)."""
    factor: float
    """Factor of these covariances, at least 1."""


@njit(cache=True)
def update_people(states, covariances, supports, of_track, rays, sigmas, floor, motion, placed):
    """Update n tracked people by the rays of their detections, in place.

    Pictures of other times than the states show where the joints were then: the states are carried to each of these
    times and back, so that velocities are corrected as well. An Ornstein-Uhlenbeck process runs backwards as it runs
    forwards, so a joint was at ``x - reach v`` (:func:`mvpose.tracking.motion.transition`), and what it did meanwhile
    adds to the errors of the picture.

    Args:
        states: predicted positions and velocities, (n, J, 6); NaN for an unknown joint.
        covariances: their covariances, (n, J, 6, 6).
        supports: output, (n, J): mean over the person's views of score times responsibility, 0 without detections.
        of_track: group of each track, (n,); -1 without detections.
        rays: :class:`MatchedRays` of m detections.
        sigmas: standard deviation of a confident keypoint, (J,), metres.
        floor: likelihood of a wrong keypoint.
        motion: :class:`mvpose.tracking.motion.JointMotion`; also of joints that are seen for the first time.
        placed: :class:`PlacedPeople`.
    """
    labels, _, origins, directions, weights, pixel, lead = rays
    speed, time, trunk = motion
    of_pose, places, spreads, confidences, factor = placed
    m, joints = weights.shape
    scratch, leads = np.empty((8, 3)), np.unique(lead)
    slowest = 0
    for j in range(joints):
        slowest = j if trunk[j] else slowest
    for t in range(len(states)):
        supports[t] = 0.0
        views = 0
        for d in range(m):
            views += of_track[t] >= 0 and labels[d] == of_track[t]
        if views == 0:
            continue
        for shift in leads:
            n = 0
            for d in range(m):
                n += labels[d] == of_track[t] and lead[d] == shift
            if n == 0:
                continue
            common = trunk_velocity(states[t], trunk)
            trunk_reach, _, trunk_noise, _, _ = transition(-shift, speed[slowest], time[slowest])
            centers, rays, scores, angles = np.empty((n, 3)), np.empty((n, 1, 3)), np.empty((n, 1)), np.empty(n)
            for j in range(joints):
                seen, v = 0, 0
                for d in range(m):
                    if labels[d] != of_track[t] or lead[d] != shift:
                        continue
                    angles[v], scores[v, 0] = pixel[d], weights[d, j]
                    seen += weights[d, j] > 0.0
                    for r in range(3):
                        centers[v, r], rays[v, 0, r] = origins[d, r], directions[d, j, r]
                    v += 1
                k = of_pose[t]
                certain = k >= 0 and seen >= 2 and confidences[k, j] > 0.0 and not np.isnan(states[t, j, 0])
                if certain and _update_by_place(states[t, j], covariances[t, j], places[k, j], spreads[k, j], factor):
                    supports[t, j] = confidences[k, j]
                elif seen:
                    reach, noise, along = trunk_reach, trunk_noise, 0.0
                    if not trunk[j]:
                        reach, _, noise, _, _ = transition(-shift, speed[j], time[j])
                        noise, along = noise + trunk_noise, trunk_reach - reach
                    view = centers, rays, scores, angles, np.sqrt(sigmas[j] ** 2 + noise), floor
                    carry(states[t, j], covariances[t, j], -reach)
                    for r in range(3):
                        states[t, j, r] -= along * common[r]
                    supports[t, j] += (
                        _update_joint(states[t, j], covariances[t, j], view, seen, speed[j], scratch) / views
                    )
                    for r in range(3):
                        states[t, j, r] += along * common[r]
                    carry(states[t, j], covariances[t, j], reach)


@njit(cache=True)
def _update_by_place(state, covariance, place, spread, factor):
    """Update one joint by a place with a covariance, in place; return whether that was possible."""
    A, b, step, point = np.empty((3, 3)), np.zeros(3), np.empty(3), np.empty(3)
    prior, evidence, both, inverse = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for r in range(3):
        for c in range(3):
            A[r, c] = factor * spread[r, c]
            both[r, c] = covariance[r, c] + A[r, c]
    if not (
        solve(A, b, evidence, step) and solve(covariance[:3, :3], b, prior, step) and solve(both, b, inverse, step)
    ):
        return False
    weight = min((_FREEDOM + 3.0) / (_FREEDOM + _mahalanobis2(place, state, inverse)), 1.0)
    for r in range(3):
        for c in range(3):
            A[r, c] = evidence[r, c] + weight * prior[r, c]
            b[r] += evidence[r, c] * (place[c] - state[c])
    if not solve(A, b, inverse, step):
        return False
    for r in range(3):
        point[r] = state[r] + step[r]
    condition(state, covariance, point, prior, inverse, np.empty((6, 3)))
    return True


@njit(cache=True)
def _update_joint(state, covariance, view, seen, speed, scratch):
    """Update one joint, in place; return the support of the rays."""
    return _fit_joint(state, covariance, view, seen, speed, scratch, np.empty((19, 3)))


@njit(cache=True, borrows=True)
def _fit_joint(state, covariance, view, seen, speed, scratch, work):
    """Update one joint as :func:`_update_joint`, with ``work`` (19, 3) as working memory."""
    origins, directions, weights, pixel, sigma, floor = view
    point, start, b, step = work[0], work[1], work[2], work[3]
    A, inverse, prior = work[4:7], work[7:10], work[10:13]
    agreed = seen >= 2 and consensus(start, view, scratch)[0] > 0.0
    if np.isnan(state[0]):
        if not agreed:
            return 0.0
        covariance[:] = 0.0
        for r in range(3):
            state[r], state[3 + r] = start[r], 0.0
            covariance[r, r], covariance[3 + r, 3 + r] = _UNKNOWN, speed * speed
    b[:] = 0.0
    if not solve(covariance[:3, :3], b, prior, step):
        return 0.0
    for r in range(3):
        point[r] = state[r]
    if agreed and _log_posterior(start, state, prior, view) > _log_posterior(point, state, prior, view):
        for r in range(3):
            point[r] = start[r]
    support = 0.0
    for _ in range(_STEPS):
        A[:] = 0.0
        b[:] = 0.0
        support = accumulate(point, origins, directions, weights, pixel, sigma, floor, 1.0, A, b)[0]
        weight = min((_FREEDOM + 3.0) / (_FREEDOM + _mahalanobis2(point, state, prior)), 1.0)
        for r in range(3):
            for c in range(3):
                A[r, c] += weight * prior[r, c]
                b[r] += weight * prior[r, c] * (state[c] - point[c])
        if not solve(A, b, inverse, step):
            return 0.0
        moved = 0.0
        for r in range(3):
            moved += step[r] ** 2
            point[r] += step[r]
        if moved < _CONVERGED:
            break
    condition(state, covariance, point, prior, inverse, work[13:])
    return support


@njit(cache=True, borrows=True)
def _mahalanobis2(point, center, inverse):
    total = 0.0
    for r in range(3):
        for c in range(3):
            total += (point[r] - center[r]) * inverse[r, c] * (point[c] - center[c])
    return max(total, 0.0)


@njit(cache=True, borrows=True)
def _log_posterior(point, state, prior, view):
    origins, directions, weights, pixel, sigma, floor = view
    value = log_likelihood(point, origins, directions, weights, pixel, sigma, floor)
    return value - 0.5 * (_FREEDOM + 3.0) * np.log(1.0 + _mahalanobis2(point, state, prior) / _FREEDOM)


def place_people(
    reconstruction: Callable[[Rays, Integers, Skeleton], Poses],
    rays: Rays,
    skeleton: Skeleton,
    labels: Integers,
    groups: Integers,
    lead: Floats,
    *,
    factor: float,
) -> PlacedPeople:
    """Place the tracked people whom several cameras see at the time of the frame.

    Triangulation uses each joint's rays alone, which the filter does better: then nobody is placed.

    Args:
        reconstruction: stage of one frame.
        rays: viewing rays of the m detections.
        skeleton: their skeleton.
        labels: group of each, (m,), or -1.
        groups: group of each track, (n,), or -1.
        lead: time from the frame to the picture of each detection, (m,), seconds.
        factor: factor of the covariances, of :func:`repetition`.
    """
    joints = len(skeleton)
    of_pose, people = np.full(len(groups), -1), np.full(len(labels), -1)
    if not isinstance(reconstruction, Triangulation):
        number_people(labels, groups, lead, of_pose, people)
    if not (people >= 0).any():
        nobody = np.empty((0, joints, 3)), np.empty((0, joints, 3, 3)), np.empty((0, joints))
        return PlacedPeople(of_pose, *nobody, 1.0)
    poses = reconstruction(rays, people, skeleton)
    return PlacedPeople(of_pose, poses.joints, poses.covariance, poses.scores, factor)


def repetition(since: float, correlation: float) -> float:
    """Return the factor of the variance of errors that repeat those of ``since`` seconds ago.

    Errors with the correlation ``exp(-t / correlation)`` average out over many frames like independent ones of
    ``coth(since / (2 correlation))`` times the variance.
    """
    return 1.0 / math.tanh(since / (2.0 * correlation)) if since > 0.0 and correlation > 0.0 else 1.0


@njit(cache=True)
def number_people(labels, groups, lead, of_pose, people):
    """Number the tracks that several cameras saw at the time of the frame, in place.

    Args:
        labels: group of each detection, (m,), or -1.
        groups: group of each track, (n,), or -1.
        lead: time from the frame to the picture of each detection, (m,), seconds.
        of_pose: output, (n,): number of the track; -1 stays where fewer than two cameras saw it, or at other times.
        people: output, (m,): number of the track of each detection.
    """
    count = 0
    for t in range(len(groups)):
        seen, late = 0, False
        for d in range(len(labels)):
            if groups[t] >= 0 and labels[d] == groups[t]:
                seen += 1
                late = late or lead[d] != 0.0
        if seen >= 2 and not late:
            of_pose[t] = count
            for d in range(len(labels)):
                if labels[d] == groups[t]:
                    people[d] = count
            count += 1
