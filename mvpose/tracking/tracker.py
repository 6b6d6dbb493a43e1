"""Online tracker: the stages of a pipeline frame by frame, with the people of the past as one more party.

A frame goes through prediction, affinity, matching, update, birth and existence. The frame of a tracker without a past
gives the people of the pipeline.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import seal
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.kernels import njit
from mvpose.ordering import number_views
from mvpose.pipeline import Pipeline, enter
from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import SHARED
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.poses import MISSING_SCORE, Poses
from mvpose.skeleton import Skeleton
from mvpose.tracking.association import TrackAffinity
from mvpose.tracking.bones import BonePrior, bone_prior, constrain, learn_lengths
from mvpose.tracking.existence import Clutter, Existence, gather_evidence, log_odds, log_presence
from mvpose.tracking.motion import JointMotion, Motion, predict
from mvpose.tracking.picture_times import FrameClock
from mvpose.tracking.pose_update import update_people
from mvpose.tracking.reappearance import Reappearance
from mvpose.tracking.tracks import Tracks

_GIVEN_UP = -7.0  # log-odds below which a track is no longer followed: one in a thousand
_ALONE = 0.5  # seconds for which one camera alone follows somebody who is likelier a ghost: the depth is a guess
_FORGETTING = 0.5  # seconds: time constant of the score of a joint that no view supports
_SAME_POSE = 0.2  # metres: mean distance between the joints of two poses of one person
_ONE_PERSON = 0.12  # metres: the same, of two tracks; people who hug are further apart


@dataclass(frozen=True)
class TrackingModel:
    """Settings of a tracker.

    Attributes:
        motion: motion of joints.
        affinity: affinity between tracks and detections.
        existence: how often people come, and how often people and ghosts are found.
        reappearance: how people who were lost come back.
        noise: error model of keypoints.
        period: time between frames whose detections carry no time, seconds.
    """

    motion: Motion = Motion()
    affinity: TrackAffinity = TrackAffinity()
    existence: Existence = Existence()
    reappearance: Reappearance = Reappearance()
    noise: Noise = Noise()
    period: float = 0.04

    def __post_init__(self) -> None:
        if not 0.0 < self.period < np.inf:
            raise ValueError(f"period must be above 0 s and finite, got {self.period}")


@dataclass
class Moment:
    """What a tracker knows after a frame, for its estimate and for smoothing.

    Attributes:
        time: time of the frame, seconds; NaN before the first picture.
        elapsed: time since the previous frame, seconds.
        tracks: tracks after the frame, with those that end here.
        predicted: state of each track before the frame, (n, J, 6), and its covariance, (n, J, 6, 6); NaN for new
            tracks.
        odds: log-odds that each track is a person, (n,).
        presence: log-odds that this person is still here, (n,).
        shown: whether each track is reported, (n,).
        owner: track of each detection, (m,), or -1.
        poses: poses of the tracks as the pipeline gives them, where the frame is the first.
        timings: seconds by stage.
    """

    time: float
    elapsed: float
    tracks: Tracks
    predicted: tuple[Floats, Floats]
    odds: Floats
    presence: Floats
    shown: Bools
    owner: Integers
    poses: Poses | None
    timings: dict[str, float]


class Tracker:
    """Tracker of the people in front of a rig: call :meth:`estimate` with one frame after the other.

    Args:
        pipeline: stages of one frame; its reconstruction places people who are seen for the first time.
        model: settings.
    """

    def __init__(self, pipeline: Pipeline | None = None, *, model: TrackingModel | None = None) -> None:
        self.pipeline = Pipeline() if pipeline is None else pipeline
        self.model = TrackingModel() if model is None else model
        self._clock = FrameClock(self.model.period, self.model.period)
        self._skeleton: Skeleton | None = None  # before the first frame
        self._born = 0  # people so far

    @property
    def time(self) -> float | None:
        """Time of the latest frame, seconds; None before the first picture."""
        return self._clock.time if self._clock.started else None

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of the next frame.

        Args:
            rig: calibrated cameras, the same in every frame.
            detections: 2D poses of all views, with the times of their pictures where they are known.

        Returns:
            The people at the time of the latest picture, with their identities. A frame without pictures gives the
            people whom the past predicts, and nobody before the first picture.

        Raises:
            ValueError: as :meth:`mvpose.Pipeline.estimate`; another rig or skeleton than in the first frame; times
                that :meth:`mvpose.tracking.picture_times.FrameClock.read` refuses. The tracker stays as it was.
        """
        return self.report(self.advance(rig, detections))

    def advance(self, rig: Rig, detections: Detections) -> Moment:
        """Take the next frame, without an estimate; see :meth:`estimate`."""
        start = clock.perf_counter()
        model, first = self.model, not self._clock.started
        chosen, ordered, rays = enter(rig, detections, self.pipeline.duplicates)
        if self._skeleton is None:
            self._start(rig, detections.skeleton)
        elif len(rig) != len(self._sizes) or detections.skeleton != self._skeleton:
            raise ValueError(
                f"a tracker serves one rig and one skeleton, {len(self._sizes)} cameras and {self._skeleton.name!r}, "
                f"got {len(rig)} and {detections.skeleton.name!r}: start another tracker"
            )
        times = self._clock.read(detections, len(rig))
        now, elapsed, pictures = times.now, times.elapsed, times.pictures
        of_use = pictures[ordered.view]
        if not of_use.all():
            chosen, ordered, rays = chosen[of_use], ordered.select(of_use), rays.select(of_use)
        affinity = self.pipeline.affinity(rig, ordered, rays)
        self._clock.take(times)
        _predict_people(self._tracks.state, self._tracks.covariance, elapsed, *self.motion)
        self._drop(now, vagueness(self._tracks.state, self._tracks.covariance) < 2.0 * model.existence.vague)
        tracks, lead = self._tracks, times.lead[ordered.view]
        before = tracks.state.copy(), tracks.covariance.copy()
        joined, views = model.affinity.join(
            affinity, number_views(ordered.view), rays, tracks.state, tracks.covariance, lead
        )
        compared = clock.perf_counter()
        labels = self.pipeline.matching(joined, views).labels
        labels, groups = labels[: len(ordered)], labels[len(ordered) :]
        matched = clock.perf_counter()
        self._update(rays, labels, groups, lead, now, elapsed)
        owner, fresh = _owners(labels, groups)
        poses = self._give_birth(
            rays, detections.skeleton, fresh, owner, now, model.existence.span(np.inf if first else elapsed)
        )
        tracks, count = self._tracks, len(before[0])
        gather_evidence(
            tracks.hits, tracks.misses, tracks.absent, tracks.origin, np.arange(len(tracks)) >= count, tracks.state,
            owner, ordered.view, rig.packed, self._sizes, pictures, tracks.found, now,
            *model.existence.weights(elapsed),
        )  # fmt: skip
        clutter = self._clutter
        odds = _odds(
            tracks.span,
            tracks.origin,
            tracks.hits,
            tracks.misses,
            clutter.density,
            clutter.flashes,
            model.existence.rates,
        )
        vague = vagueness(tracks.state, tracks.covariance)
        here = _log_presence(tracks.absent, now - tracks.seen, *model.existence.presence)
        shown = (odds > 0.0) & (here > 0.0) & (vague < model.existence.vague) | first
        tracks.reported |= shown
        false = np.ones(len(owner), np.float64)  # probability that a detection shows nobody
        false[owner >= 0] = 1.0 / (1.0 + np.exp(np.clip(odds[owner[owner >= 0]], -50.0, 50.0)))
        clutter.count(np.bincount(ordered.view, false, len(rig)).astype(np.float64), pictures, elapsed)
        given = np.full(len(detections), -1)
        given[chosen] = owner
        new = len(tracks) - count
        moment = Moment(
            now, elapsed, tracks.select(np.arange(len(tracks))),
            (_with_nan(before[0], new), _with_nan(before[1], new)),
            odds, here, shown, given, poses if first else None, {},
        )  # fmt: skip
        self._drop(
            now,
            (odds > _GIVEN_UP)
            & (vague < 2.0 * model.existence.vague)
            & ((odds > 0.0) | (now - tracks.agreed < _ALONE))
            & ~_absorbed(tracks.state, vague, _ONE_PERSON),
        )
        end = clock.perf_counter()
        moment.timings.update(
            affinity=compared - start, matching=matched - compared, reconstruction=end - matched, total=end - start
        )
        return moment

    def report(self, moment: Moment) -> Estimate:
        """Return the estimate of a moment."""
        start = clock.perf_counter()
        tracks, shown = moment.tracks, moment.shown
        number = np.where(shown, np.cumsum(shown) - 1, -1)
        labels = np.where(moment.owner >= 0, number[moment.owner] if len(number) else -1, -1)
        if moment.poses is None:
            joints, covariance = constrain_people(tracks, self._bones)
            joints, covariance, scores, freedom = joints[shown], covariance[shown], tracks.scores[shown], None
            covariance = covariance + (SHARED * self._sigmas[:, None, None]) ** 2 * np.eye(3)  # no residual shows it
            joints[scores == 0.0] = covariance[scores == 0.0] = np.nan
            scores = np.where(np.isnan(joints[..., 0]), 0.0, scores)
        else:
            joints, scores, covariance, freedom = moment.poses
        seal(joints, covariance, scores, labels)
        seconds = clock.perf_counter() - start
        timings = {key: value + seconds * (key in ("reconstruction", "total")) for key, value in moment.timings.items()}
        return Estimate(
            joints,
            scores,
            Matching(labels),
            covariance,
            timings,
            freedom,
            ids=tracks.ids[shown],
            time=None if np.isnan(moment.time) else moment.time,
        )

    def _start(self, rig: Rig, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        self._sizes = np.array([camera.size for camera in rig], float)
        self.motion: JointMotion = self.model.motion.of_joints(skeleton)
        self._bones: BonePrior = bone_prior(skeleton)
        self._sigmas = self.model.noise.sigmas(skeleton)
        self._clutter = Clutter(self.model.existence, len(rig))
        self._tracks = self._lost = Tracks.none(joints=len(skeleton), bones=len(self._bones.length), cameras=len(rig))

    def _update(self, rays: Rays, labels: Integers, groups: Integers, lead: Floats, now: float, elapsed: float) -> None:
        """Update tracks by the detections that were matched with them."""
        tracks, noise = self._tracks, self.model.noise
        supports = np.empty_like(tracks.scores)
        update_people(
            tracks.state, tracks.covariance, supports, labels, groups, rays.origins, rays.directions, rays.weights,
            noise.pixels * rays.pixel, lead, self._sigmas, noise.floor, self.motion.speed,
        )  # fmt: skip
        faded = tracks.scores * np.exp(-elapsed / _FORGETTING)
        faded[faded <= MISSING_SCORE] = 0.0
        tracks.scores = np.where(supports > MISSING_SCORE, supports, faded)
        _learn(tracks.length, tracks.variance, tracks.state, tracks.covariance, groups, self._bones.ends, elapsed)

    def _give_birth(
        self, rays: Rays, skeleton: Skeleton, fresh: Integers, owner: Integers, now: float, span: float
    ) -> Poses:
        """Start tracks of the groups ``fresh`` (m,) of detections that belong to nobody known; set their owner.

        A group that repeats the pose of a track is left out: its detections were torn from that person's.
        """
        poses = self.pipeline.reconstruction(rays, fresh, skeleton)
        if not len(poses.joints):
            return poses
        tracks, count, cameras = self._tracks, len(poses.joints), len(self._sizes)
        new = ~_repeats(poses.joints, tracks.state, _SAME_POSE)
        born = Tracks.born(
            poses, ids=np.zeros(count, np.int64), time=now, span=span, speed=self.motion.speed,
            bones=self._bones, cameras=cameras,
        ).select(new)  # fmt: skip
        back = self.model.reappearance.match(
            born, self._lost, time=now, motion=self.model.motion, trunk=self.motion.trunk
        )
        for k, lost in enumerate(back):
            if lost >= 0:
                born.resume(k, self._lost, lost)
            else:
                born.ids[k], self._born = self._born, self._born + 1
        remain = np.ones(len(self._lost), np.bool_)
        remain[back[back >= 0]] = False
        self._lost = self._lost.select(remain)
        slot = np.where(new, len(tracks) + np.cumsum(new) - 1, -1)
        owner[fresh >= 0] = slot[fresh[fresh >= 0]]
        self._tracks = tracks.join(born)
        return poses

    def _drop(self, now: float, followed: Bools) -> None:
        """Stop to follow tracks; those who were people may come back."""
        tracks = self._tracks
        if not followed.all():
            self._clutter.vanish(now - tracks.born_at[~followed])
            self._lost = self._lost.join(tracks.select(~followed & tracks.reported))
            self._tracks = tracks.select(followed)
        if len(self._lost):
            self._lost = self._lost.select(now - self._lost.seen < self.model.reappearance.memory)


def constrain_people(tracks: Tracks, bones: BonePrior) -> tuple[Floats, Floats]:
    """Return the joints of tracks (n, J, 3), shaped by their bone lengths, and covariances (n, J, 3, 3)."""
    joints, covariance = np.empty((*tracks.state.shape[:2], 3)), np.empty((*tracks.state.shape[:2], 3, 3))
    _constrain(joints, covariance, tracks.state, tracks.covariance, bones.ends, tracks.length, tracks.variance)
    return joints, covariance


def _with_nan(array: Floats, rows: int) -> Floats:
    """Return an array with rows of NaN appended."""
    return np.concatenate([array, np.full((rows, *array.shape[1:]), np.nan)])


@njit(cache=True)
def _predict_people(state, covariance, elapsed, speed, time, trunk):
    for t in range(len(state)):
        predict(state[t], covariance[t], elapsed, speed, time, trunk)


@njit(cache=True)
def _learn(length, variance, state, covariance, groups, ends, elapsed):
    for t in range(len(state)):
        if groups[t] >= 0:
            learn_lengths(length[t], variance[t], state[t], covariance[t], ends, elapsed)


@njit(cache=True)
def _constrain(joints, covariance, state, moments, ends, length, variance):
    for t in range(len(state)):
        constrain(joints[t], covariance[t], state[t], moments[t], ends, length[t], variance[t])


@njit(cache=True)
def _odds(span, origin, hits, misses, density, flashes, rates):
    odds = np.empty(len(hits))
    for t in range(len(hits)):
        odds[t] = log_odds(span[t], origin[t], hits[t], misses[t], density, flashes, rates)
    return odds


@njit(cache=True)
def _log_presence(absent, since, departures, found, seeable):
    presence = np.empty(len(absent))
    for t in range(len(absent)):
        presence[t] = log_presence(absent[t], since[t], departures, found, seeable)
    return presence


@njit(cache=True)
def vagueness(state, covariance):
    """Return the standard deviation along an axis of each track's best-known joint, (n,), metres."""
    least = np.full(len(state), np.inf)
    for t in range(len(state)):
        for j in range(state.shape[1]):
            if not np.isnan(state[t, j, 0]):
                total = covariance[t, j, 0, 0] + covariance[t, j, 1, 1] + covariance[t, j, 2, 2]
                least[t] = min(least[t], np.sqrt(max(total, 0.0) / 3.0))
    return least


@njit(cache=True)
def _owners(labels, groups):
    """Return the track of each detection, (m,), and the number of its group without a track, (m,); -1 for neither.

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
    return owner, fresh


@njit(cache=True)
def _absorbed(state, vague, distance):
    """Return which tracks lie within a mean distance of a better-known one, (n,): they follow its person."""
    absorbed = np.zeros(len(state), np.bool_)
    for t in range(len(state)):
        for other in range(len(state)):
            better = vague[other] < vague[t] or (vague[other] == vague[t] and other < t)
            if better and not absorbed[other] and _mean_distance(state[t], state[other]) < distance:
                absorbed[t] = True
    return absorbed


@njit(cache=True)
def _mean_distance(one, other):
    """Return the mean distance of the joints that two poses (J, 3 or more) have; infinite if there are none."""
    total, count = 0.0, 0
    for j in range(len(one)):
        if not np.isnan(one[j, 0]) and not np.isnan(other[j, 0]):
            x, y, z = one[j, 0] - other[j, 0], one[j, 1] - other[j, 1], one[j, 2] - other[j, 2]
            total += np.sqrt(x * x + y * y + z * z)
            count += 1
    return total / count if count else np.inf


@njit(cache=True)
def _repeats(joints, state, distance):
    """Return which poses (k, J, 3) lie within a mean distance of those of a track (n, J, 6), (k,)."""
    repeats = np.zeros(len(joints), np.bool_)
    for k in range(len(joints)):
        for t in range(len(state)):
            repeats[k] = repeats[k] or _mean_distance(joints[k], state[t]) < distance
    return repeats
