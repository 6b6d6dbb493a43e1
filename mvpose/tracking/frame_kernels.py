"""Work of a tracker on one frame, in four kernels on plain arrays.

A frame of few people takes tens of microseconds, as long as a dozen calls of NumPy, so each step is one kernel: predict
all tracks, update them by their detections, judge who is there, and report.
"""

import numpy as np

from mvpose.kernels import njit
from mvpose.reconstruction.poses import MISSING_SCORE
from mvpose.tracking.bones import constrain, learn_lengths
from mvpose.tracking.existence import gather_evidence, log_odds, log_presence
from mvpose.tracking.motion import note_displacement, predict
from mvpose.tracking.pose_update import update_people

_GIVEN_UP = -7.0  # log-odds below which a track is no longer followed: one in a thousand
_ALONE = 0.5  # seconds for which one camera alone follows somebody who is likelier a ghost: the depth is a guess
_ONE_FRAME = 0.1  # metres: standard deviation of the place of a trunk in one frame
_FARTHEST = 16.3  # squared distance in variances, chi-square of three degrees of freedom at 0.001
_HIDDEN = 0.5  # part of the largest spread up to which people are followed whom pictures should show and do not
_SAME_POSE = 0.2  # metres: distance between most joints of two poses of one person
_ONE_PERSON = 0.12  # metres: the same, of two tracks; people who hug are further apart
_FARTHEST_ODDS = 50.0  # log-odds beyond which a probability is 0 or 1 to the last digit


@njit(cache=True)
def predict_tracks(state, covariance, elapsed, speed, time, trunk, vague):
    """Carry tracks forward by ``elapsed`` seconds, in place; return whether the place of each is still known, (n,).

    Args:
        state: positions and velocities, (n, J, 6).
        covariance: their covariances, (n, J, 6, 6).
        elapsed: seconds.
        speed: standard deviation of a component of the velocity of each joint, (J,), m/s.
        time: time after which it is correlated by 1/e, (J,), seconds.
        trunk: whether each joint belongs to the trunk, (J,).
        vague: standard deviation of the best-known joint from which on the place is unknown, metres.

    Returns:
        The mask, and whether it is true for all tracks.
    """
    known, everyone = np.ones(len(state), np.bool_), True
    for t in range(len(state)):
        predict(state[t], covariance[t], elapsed, speed, time, trunk)
        known[t] = vagueness_of(state[t], covariance[t]) < vague
        everyone = everyone and known[t]
    return known, everyone


@njit(cache=True)
def update_tracks(tracks, groups, rays, sigmas, floor, motion, placed, ends, elapsed, keep):
    """Update tracks by the detections that were matched with them, in place.

    Args:
        tracks: :class:`mvpose.tracking.tracks.TrackedPoses` of n tracks.
        groups: group of each track, (n,), or -1.
        rays: :class:`mvpose.tracking.pose_update.MatchedRays` of m detections.
        sigmas: standard deviation of a confident keypoint, (J,), metres.
        floor: likelihood of a wrong keypoint.
        motion: :class:`mvpose.tracking.motion.JointMotion`.
        placed: :class:`mvpose.tracking.pose_update.PlacedPeople`.
        ends: joints at the ends of the bones, (B, 2).
        elapsed: time since the previous frame, seconds.
        keep: share of its score that a joint keeps which no view supports.

    Returns:
        The track of each detection, (m,), and the number of its group without a track, (m,), -1 for neither; the number
        of these groups.
    """
    state, covariance, scores, length, variance = tracks
    supports, groups = np.empty(scores.shape), groups.copy()
    before, spread = state.copy(), covariance.copy()
    update_people(state, covariance, supports, groups, rays, sigmas, floor, motion, placed)
    for t in range(len(state)):
        if groups[t] >= 0 and _jumped(before[t], spread[t], state[t], motion.trunk):
            groups[t], supports[t], state[t], covariance[t] = -1, 0.0, before[t], spread[t]
        for j in range(scores.shape[1]):
            faded = scores[t, j] * keep
            if supports[t, j] > MISSING_SCORE:
                scores[t, j] = supports[t, j]
            else:
                scores[t, j] = faded if faded > MISSING_SCORE else 0.0
        if groups[t] >= 0:
            learn_lengths(length[t], variance[t], state[t], covariance[t], ends, elapsed)
    return _owners(rays.labels, groups)


@njit(cache=True)
def _jumped(before, covariance, after, trunk):
    """Return whether the trunk (J, 6) moved further than a person can: beyond all but one in a thousand predictions."""
    way, variance, count = np.zeros(3), _ONE_FRAME * _ONE_FRAME, 0
    for j in range(len(trunk)):
        if trunk[j] and not np.isnan(before[j, 0]):
            count += 1
            for r in range(3):
                way[r] += after[j, r] - before[j, r]
    for j in range(len(trunk)):
        if trunk[j] and not np.isnan(before[j, 0]):
            for r in range(3):
                variance += covariance[j, r, r] / (3.0 * count)
    return count > 0 and (way**2).sum() > _FARTHEST * variance * count * count


@njit(cache=True)
def _owners(labels, groups):
    """Return track and new group of each detection; see :func:`update_tracks`.

    Groups without a track are numbered in the order of their labels, so that without any track they are the labels.
    """
    m, n = len(labels), len(groups)
    owner, fresh = np.full(m, -1), np.full(m, -1)
    most = labels.max() if m else -1
    number = np.full(most + 1, -1)
    for d in range(m):
        if labels[d] >= 0:
            number[labels[d]] = -2
    for t in range(n):
        if 0 <= groups[t] <= most:
            number[groups[t]] = t
    count = 0
    for label in range(most + 1):
        if number[label] == -2:
            number[label] = n + count
            count += 1
    for d in range(m):
        if labels[d] >= 0 and number[labels[d]] < n:
            owner[d] = number[labels[d]]
        elif labels[d] >= 0:
            fresh[d] = number[labels[d]] - n
    return owner, fresh, count


@njit(cache=True)
def judge_tracks(
    state, covariance, span, origin, hits, misses, absent, found, anchor, moved, reported, new, owner, view, cameras,
    sizes, pictures, since, independent, memory, density, flashes, rates, presence, now, vague, first,
):  # fmt: skip
    """Gather the evidence of a frame for and against each track, and decide who is a person and who is present.

    The arrays are no named tuples: to pass those from Python takes half as long as the kernel itself.

    Args:
        state: positions and velocities, (n, J, 6).
        covariance: their covariances, (n, J, 6, 6).
        span: time before its birth in which each may have come, (n,), seconds.
        origin: views that each was born from, (n, V), written for new tracks.
        hits: effective number of pictures of each camera that found the person, (n, V), updated.
        misses: effective number of pictures that should have and did not, (n, V), updated.
        absent: those since one last did, (n, V), updated.
        found: time at which each camera last found the track, (n, V), seconds, updated.
        anchor: place of each joint when it was first known, (n, J, 3), metres, updated.
        moved: how far the body has been from there, (n,), metres, updated.
        reported: whether the track has ever been reported as a person, (n,), updated.
        new: number of the last tracks that were born in this frame.
        owner: track of each detection, (m,), or -1.
        view: camera of each detection, (m,).
        cameras: :attr:`mvpose.camera.Rig.packed`, (V, 22).
        sizes: width and height, (V, 2), pixels.
        pictures: whether each camera gave a picture, (V,).
        since: time from the previous picture of each camera, (V,), seconds.
        independent: time between independent pictures, seconds.
        memory: time after which pictures are forgotten, seconds.
        density: false detections in a picture of each view, (V,).
        flashes: groups per second that vanish as soon as they come.
        rates: :attr:`mvpose.tracking.existence.Existence.rates`.
        presence: :attr:`mvpose.tracking.existence.Existence.presence`.
        now: time of the frame, seconds.
        vague: standard deviation of the best-known joint above which nobody is reported, metres.
        first: whether this is the first frame, in which everybody is reported.

    Returns:
        Log-odds that each track is a person and that this person is present, (n,) each; whether each is reported, (n,);
        whether it is followed further, (n,), and whether all are; expected false detections of each view, (V,).
    """
    n = len(state)
    fresh = np.arange(n) >= n - new
    evidence, taken = (origin, hits, misses, absent, found), (cameras, sizes, pictures, since)
    gather_evidence(evidence, taken, fresh, state, owner, view, now, independent, memory)
    note_displacement(anchor, moved, state, found, now)
    departures, in_picture, seeable = presence
    odds, here, spread, agreed = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    shown, followed, everyone = np.zeros(n, np.bool_), np.zeros(n, np.bool_), True
    for t in range(n):
        odds[t] = log_odds(span[t], origin[t], hits[t], misses[t], moved[t], density, flashes, rates)
        seen, agreed[t] = _latest_two(found[t])
        here[t] = log_presence(absent[t], now - seen, departures, in_picture, seeable)
        spread[t] = vagueness_of(state[t], covariance[t])
        shown[t] = first or (odds[t] > 0.0 and here[t] > 0.0 and spread[t] < vague)
        reported[t] = reported[t] or shown[t]
    absorbed = _absorbed(state, spread, hits, origin)
    for t in range(n):
        earned = odds[t] > 0.0 or (odds[t] > _GIVEN_UP and now - agreed[t] < _ALONE)
        # The prediction of a person without detections, in views that should show them, soon fits anybody's.
        vaguest = 2.0 * vague if here[t] > 0.0 else _HIDDEN * vague
        followed[t] = earned and spread[t] < vaguest and not absorbed[t]
        everyone = everyone and followed[t]
    false = np.zeros(len(pictures))
    for d in range(len(owner)):
        chance = 1.0
        if owner[d] >= 0:
            chance = 1.0 / (1.0 + np.exp(min(max(odds[owner[d]], -_FARTHEST_ODDS), _FARTHEST_ODDS)))
        false[view[d]] += chance
    return odds, here, shown, followed, everyone, false


@njit(cache=True, borrows=True)
def _latest_two(times):
    """Return the greatest and the second greatest time."""
    latest, second = -np.inf, -np.inf
    for time in times:
        if time > latest:
            latest, second = time, latest
        elif time > second:
            second = time
    return latest, second


@njit(cache=True)
def report_tracks(shown, tracks, ends, shared, owner, chosen, detections):
    """Return joints, covariances and scores of the tracks that are reported, and the person of each detection.

    Args:
        shown: whether each track is reported, (n,).
        tracks: :class:`mvpose.tracking.tracks.TrackedPoses`.
        ends: joints at the ends of the bones, (B, 2).
        shared: standard deviation of the error that all views share, (J,), metres: no residual shows it.
        owner: track of each detection that took part, (k,), or -1.
        chosen: their indices, (k,).
        detections: number of detections of the frame, m.
    """
    state, covariance, scores, length, variance = tracks
    number, count = np.full(len(shown), -1), 0
    for t in range(len(shown)):
        if shown[t]:
            number[t] = count
            count += 1
    size = state.shape[1]
    joints, spread, confidence = np.empty((count, size, 3)), np.empty((count, size, 3, 3)), np.empty((count, size))
    for t in range(len(shown)):
        if number[t] < 0:
            continue
        k = number[t]
        constrain(joints[k], spread[k], state[t], covariance[t], ends, length[t], variance[t])
        for j in range(size):
            confidence[k, j] = scores[t, j]
            if scores[t, j] == 0.0 or np.isnan(joints[k, j, 0]):
                confidence[k, j] = 0.0
                joints[k, j] = np.nan
                spread[k, j] = np.nan
            for r in range(3):
                spread[k, j, r, r] += shared[j] ** 2
    labels = np.full(detections, -1)
    for d in range(len(owner)):
        if owner[d] >= 0:
            labels[chosen[d]] = number[owner[d]]
    return joints, spread, confidence, labels


@njit(cache=True, borrows=True)
def vagueness_of(state, covariance):
    """Return the standard deviation along an axis of the best-known joint of one track, metres."""
    least = np.inf
    for j in range(len(state)):
        if not np.isnan(state[j, 0]):
            total = covariance[j, 0, 0] + covariance[j, 1, 1] + covariance[j, 2, 2]
            least = min(least, np.sqrt(max(total, 0.0) / 3.0))
    return least


@njit(cache=True)
def _absorbed(state, spread, hits, origin):
    """Return which tracks share most joints with one of more pictures, (n,): they follow its person."""
    absorbed, seen = np.zeros(len(state), np.bool_), np.empty(len(state))
    for t in range(len(state)):
        seen[t] = hits[t].sum() + origin[t].sum()
    for t in range(len(state)):
        for other in range(len(state)):
            alike = seen[other] == seen[t]
            better = seen[other] > seen[t] or (
                alike and (spread[other] < spread[t] or (spread[other] == spread[t] and other < t))
            )
            if better and not absorbed[other] and _share_joints(state[t], state[other], _ONE_PERSON):
                absorbed[t] = True
    return absorbed


@njit(cache=True)
def repeats(joints, state):
    """Return which poses (k, J, 3) share most joints with a track (n, J, 6), (k,)."""
    result = np.zeros(len(joints), np.bool_)
    for k in range(len(joints)):
        for t in range(len(state)):
            result[k] = result[k] or _share_joints(joints[k], state[t], _SAME_POSE)
    return result


@njit(cache=True, borrows=True)
def _share_joints(one, other, reach):
    """Return whether most of the joints that two poses (J, 3 or more) have lie within a distance of each other.

    No two people do: even those who hug face each other. A detection with the trunk of one person and the legs of
    another is not a person of its own, though the mean distance of its joints may be large.
    """
    near, count = 0, 0
    for j in range(len(one)):
        if not np.isnan(one[j, 0]) and not np.isnan(other[j, 0]):
            x, y, z = one[j, 0] - other[j, 0], one[j, 1] - other[j, 1], one[j, 2] - other[j, 2]
            near += x * x + y * y + z * z < reach * reach
            count += 1
    return 2 * near > count
