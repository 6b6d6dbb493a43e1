"""Online tracker: the stages of a pipeline frame by frame, with the people of the past as one more party.

A frame goes through prediction, affinity, matching, update, birth and existence. The frame of a tracker without a past
gives the people of the pipeline.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import seal
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.ordering import number_views
from mvpose.pipeline import Pipeline, enter
from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import SHARED
from mvpose.reconstruction.likelihood import Noise
from mvpose.reconstruction.poses import Poses
from mvpose.reconstruction.triangulation import Triangulation
from mvpose.skeleton import Skeleton
from mvpose.tracking.association import TrackAffinity
from mvpose.tracking.bones import BonePrior, bone_prior
from mvpose.tracking.existence import Clutter, Existence
from mvpose.tracking.frame_kernels import (
    judge_tracks,
    number_people,
    predict_tracks,
    repeats,
    report_tracks,
    update_tracks,
)
from mvpose.tracking.looks import learn_looks, nearest_rival, scale_of
from mvpose.tracking.motion import JointMotion, Motion
from mvpose.tracking.picture_times import FrameClock
from mvpose.tracking.reappearance import Reappearance
from mvpose.tracking.recent_pictures import RecentPictures
from mvpose.tracking.rolling_shutter import readouts, undo_rolling
from mvpose.tracking.state import TrackerState, check_serves, layout, of_tracks
from mvpose.tracking.tracks import Tracks

_FORGETTING = 0.5  # seconds: time constant of the score of a joint that no view supports


@dataclass(frozen=True)
class TrackingModel:
    """Settings of a tracker.

    Attributes:
        motion: motion of joints.
        affinity: affinity between tracks and detections.
        existence: how often people come, and how often people and ghosts are found.
        reappearance: how people who were lost come back.
        noise: error model of keypoints.
        correlation: time over which the errors of poses are correlated, seconds: wrong keypoints last 0.2 to 0.3 s,
            others change faster.
        period: time between frames whose detections carry no time, seconds.
    """

    motion: Motion = Motion()
    affinity: TrackAffinity = TrackAffinity()
    existence: Existence = Existence()
    reappearance: Reappearance = Reappearance()
    noise: Noise = Noise()
    correlation: float = 0.15
    period: float = 0.04

    def __post_init__(self) -> None:
        if not 0.0 <= self.correlation < np.inf:
            raise ValueError(f"correlation must be 0 s or more and finite, got {self.correlation}")
        if not 0.0 < self.period < np.inf:
            raise ValueError(f"period must be above 0 s and finite, got {self.period}")


def repetition(since: float, correlation: float) -> float:
    """Return the factor of the variance of errors that repeat those of ``since`` seconds ago.

    Errors with the correlation ``exp(-t / correlation)`` average out over many frames like independent ones of
    ``coth(since / (2 correlation))`` times the variance.
    """
    return 1.0 / math.tanh(since / (2.0 * correlation)) if since > 0.0 and correlation > 0.0 else 1.0


@dataclass
class Moment:
    """What a tracker knows after a frame, for its estimate and for smoothing.

    Attributes:
        time: time of the frame, seconds; NaN before the first picture.
        elapsed: time since the previous frame, seconds.
        tracks: tracks after the frame, with those that end here.
        predicted: state of each track before the frame, (n, J, 6), and its covariance, (n, J, 6, 6); NaN for new
            tracks. None where nobody smooths.
        odds: log-odds that each track is a person, (n,).
        presence: log-odds that this person is still here, (n,).
        shown: whether each track is reported, (n,).
        owner: track of each detection that took part, (k,), or -1.
        chosen: indices of these detections, (k,).
        detections: number of detections of the frame.
        poses: poses of the tracks as the pipeline gives them, where the frame is the first.
        timings: seconds by stage.
        link: row of each track in the next moment and the gains of the smoother, where they are known already.
    """

    time: float
    elapsed: float
    tracks: Tracks
    predicted: tuple[Floats, Floats] | None
    odds: Floats
    presence: Floats
    shown: Bools
    owner: Integers
    chosen: Integers
    detections: int
    poses: Poses | None
    timings: dict[str, float]
    link: tuple[Integers, Floats] | None = None


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
        self._born = 0  # people so far
        self._rig: Rig | None = None  # before the first frame, and after a restoration
        self._skeleton: Skeleton | None = None
        self._layout: Mapping[str, NDArray[Any]] | None = None  # rig and skeleton of the first frame

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

    def advance(self, rig: Rig, detections: Detections, *, keep: bool = False) -> Moment:
        """Take the next frame, without an estimate; see :meth:`estimate`.

        Args:
            rig: calibrated cameras.
            detections: detections of the frame.
            keep: whether the moment is still needed after the next frame; else it shares memory with the tracker.
        """
        start = clock.perf_counter()
        model, first = self.model, not self._clock.started
        chosen, ordered, rays = enter(rig, detections, self.pipeline.duplicates)
        if rig is not self._rig or detections.skeleton is not self._skeleton:
            self._serve(rig, detections.skeleton)
        times = self._clock.read(detections, len(rig))
        now, elapsed, pictures = times.now, times.elapsed, times.pictures
        if times.some_unused:
            of_use = pictures[ordered.view]
            chosen, ordered, rays = chosen[of_use], ordered.select(of_use), rays.select(of_use)
        affinity = self.pipeline.affinity(rig, ordered, rays)
        if ordered.descriptors is not None:
            self._see_looks(ordered.descriptors.shape[1])
        self._clock.take(times)
        tracks, vague = self._tracks, model.existence.vague
        known, all_known = predict_tracks(tracks.state, tracks.covariance, elapsed, *self.motion, 2.0 * vague)
        self._drop(now, known, all_known)
        tracks = self._tracks
        before = (tracks.state.copy(), tracks.covariance.copy()) if keep else None
        lead, count = times.lead[ordered.view], len(tracks)
        joined, views = model.affinity.join(
            affinity, number_views(ordered.view), rays, tracks.state, tracks.covariance, lead
        )
        compared = clock.perf_counter()
        labels = self.pipeline.matching(joined, views).labels
        matched = clock.perf_counter()
        m, noise, bones, rays = len(ordered), model.noise, self._bones, self._at_once(ordered, rays, labels)
        placed = self._place(rays, detections.skeleton, labels[:m], labels[m:], lead, elapsed)
        owner, fresh, groups = update_tracks(
            tracks.state, tracks.covariance, tracks.scores, tracks.length, tracks.variance, labels[:m],
            labels[m:], rays.origins, rays.directions, rays.weights, noise.pixels * rays.pixel, lead, self._sigmas,
            noise.floor, *self.motion, *placed, bones.ends, elapsed, float(np.exp(-elapsed / _FORGETTING)),
        )  # fmt: skip
        poses: Poses | None = None
        since = self._recent.take(now, times.lead, pictures)
        span = model.existence.span(float(since.min(where=pictures, initial=np.inf)))
        if groups or first:
            poses = self._give_birth(rays, ordered, fresh, owner, now, span)
        shown_by, in_view = owner, ordered.view
        if self._recent.wait_for(now, pictures):
            partners, cameras = self._pair_with_recent(rig, ordered, lead, owner, now, span)
            shown_by, in_view = np.concatenate([owner, partners]), np.concatenate([in_view, cameras])
        self._recent.add(ordered, owner < 0)
        tracks, new = self._tracks, len(self._tracks) - count
        if ordered.descriptors is not None:
            learn_looks(tracks.looks, tracks.described, owner, ordered.descriptors, elapsed)
        odds, here, shown, followed, all_followed, false = judge_tracks(
            tracks.state, tracks.covariance, tracks.span, tracks.origin, tracks.hits, tracks.misses, tracks.absent,
            tracks.found, tracks.reported, new, shown_by, in_view, rig.packed, self._sizes, pictures, since,
            *model.existence.correlation, self._clutter.density, self._clutter.flashes, model.existence.rates,
            model.existence.presence, now, vague, first,
        )  # fmt: skip
        self._clutter.count(false, pictures, since, elapsed)
        if before is not None:
            tracks, before = tracks.snapshot(), (_with_nan(before[0], new), _with_nan(before[1], new))
        moment = Moment(
            now,
            elapsed,
            tracks,
            before,
            odds,
            here,
            shown,
            owner,
            chosen,
            len(detections),
            poses if first else None,
            {},
        )
        self._drop(now, followed, all_followed)
        end = clock.perf_counter()
        moment.timings.update(
            affinity=compared - start, matching=matched - compared, reconstruction=end - matched, total=end - start
        )
        return moment

    def report(self, moment: Moment) -> Estimate:
        """Return the estimate of a moment."""
        start = clock.perf_counter()
        tracks = moment.tracks
        joints, covariance, scores, labels = report_tracks(
            moment.shown, tracks.state, tracks.covariance, tracks.scores, tracks.length, tracks.variance,
            self._bones.ends, SHARED * self._sigmas, moment.owner, moment.chosen, moment.detections,
        )  # fmt: skip
        ids, freedom = tracks.ids[moment.shown], None
        if moment.poses is not None:
            joints, scores, covariance, freedom = moment.poses
        seal(joints, covariance, scores, labels, ids)
        seconds = clock.perf_counter() - start
        timings = dict(moment.timings)
        timings["reconstruction"] += seconds
        timings["total"] += seconds
        time = None if math.isnan(moment.time) else moment.time
        return Estimate(joints, scores, Matching(labels), covariance, timings, freedom, ids=ids, time=time)

    def state(self) -> TrackerState:
        """Return all that the tracker knows of the past, for :meth:`restored`.

        Estimates that a lag still holds back (:func:`mvpose.tracking.track`) are no part of it.

        Raises:
            ValueError: before the first frame, when nothing is known.
        """
        if self._layout is None:
            raise ValueError("a tracker has no state before its first frame")
        watch, clutter = self._clock, self._clutter
        return TrackerState(
            {
                **self._layout,
                "clock": np.array([watch.interval, watch.time, watch.pictured]),
                "born": np.array([self._born]),
                "density": clutter.density,
                "watched": clutter.watched,
                "clutter": clutter.counts,
                **of_tracks(self._tracks, self._lost),
                **{f"recent.{name}": array for name, array in self._recent.state().items()},
            }
        )

    @classmethod
    def restored(
        cls, state: TrackerState, pipeline: Pipeline | None = None, *, model: TrackingModel | None = None
    ) -> Self:
        """Return a tracker that goes on where another one was.

        Args:
            state: of the other tracker.
            pipeline: as for the class; the same as that of the other tracker for the same estimates.
            model: the same.
        """
        tracker, arrays = cls(pipeline, model=model), state.arrays
        tracker._layout = {name: arrays[name] for name in arrays if name.startswith(("version", "rig.", "skeleton."))}
        tracker._clock = FrameClock(tracker.model.period, *map(float, arrays["clock"]))
        tracker._born = int(arrays["born"][0])
        tracker._clutter = Clutter(tracker.model.existence, len(arrays["density"]))
        tracker._clutter.density, tracker._clutter.counts = arrays["density"].copy(), arrays["clutter"].copy()
        tracker._clutter.watched = arrays["watched"].copy()
        tracker._tracks, tracker._lost = state.group("tracks"), state.group("lost")
        tracker._recent = RecentPictures.restored(state.recent)
        return tracker

    def _serve(self, rig: Rig, skeleton: Skeleton) -> None:
        """Start with a rig and a skeleton; refuse others in later frames."""
        bones = bone_prior(skeleton)
        if self._layout is None:
            self._layout = layout(rig, skeleton)
            self._clutter = Clutter(self.model.existence, len(rig))
            self._recent = RecentPictures(len(rig), len(skeleton))
            self._tracks = self._lost = Tracks.none(joints=len(skeleton), bones=len(bones.length), cameras=len(rig))
        else:
            check_serves(self._layout, rig, skeleton)
        self._rig, self._skeleton = rig, skeleton
        self._sizes = np.array([camera.size for camera in rig], float)
        self._readout = readouts(rig)
        self.motion: JointMotion = self.model.motion.of_joints(skeleton)
        self._bones: BonePrior = bones
        self._sigmas = self.model.noise.sigmas(skeleton)

    def _at_once(self, ordered: Detections, rays: Rays, labels: Integers) -> Rays:
        """Return viewing rays as if all rows of a picture were exposed at once."""
        if self._readout is None:
            return rays
        m = len(ordered)
        directions = undo_rolling(
            self._readout, ordered.view, ordered.keypoints, rays.origins, rays.directions, rays.weights, labels[:m],
            labels[m:], self._tracks.state,
        )  # fmt: skip
        return Rays(rays.view, rays.origins, directions, rays.weights, rays.pixel, rays.modes)

    def _see_looks(self, dimensions: int) -> None:
        """Make room for descriptors of a length, or refuse another length than before."""
        known = self._tracks.looks.shape[1]
        if not known:
            self._tracks, self._lost = self._tracks.widened(dimensions), self._lost.widened(dimensions)
        elif dimensions not in (0, known):
            raise ValueError(
                f"descriptors must be (m, {known}) as in earlier frames, got (m, {dimensions}): start another tracker"
            )

    def _place(
        self, rays: Rays, skeleton: Skeleton, labels: Integers, groups: Integers, lead: Floats, elapsed: float
    ) -> tuple[Integers, Floats, Floats, Floats, float]:
        """Return the poses of tracked people as the stages of a frame place them, for :func:`update_tracks`.

        Triangulation uses each joint's rays alone, which the update does better: it then gets no pose.
        """
        count, joints = len(groups), len(skeleton)
        of_pose, people = np.full(count, -1), np.full(len(labels), -1)
        if not isinstance(self.pipeline.reconstruction, Triangulation):
            number_people(labels, groups, lead, of_pose, people)
        if not (people >= 0).any():
            return of_pose, np.empty((0, joints, 3)), np.empty((0, joints, 3, 3)), np.empty((0, joints)), 1.0
        poses = self.pipeline.reconstruction(rays, people, skeleton)
        factor = repetition(elapsed, self.model.correlation)
        return of_pose, poses.joints, poses.covariance, poses.scores, factor

    def _give_birth(
        self,
        rays: Rays,
        detections: Detections,
        fresh: Integers,
        owner: Integers,
        now: float,
        span: float,
        motion: float = 0.0,
    ) -> Poses:
        """Start tracks of the groups ``fresh`` (m,) of detections that belong to nobody known; set their owner.

        A group that repeats the pose of a track is left out: its detections were torn from that person's. ``motion`` is
        the time, in seconds, in which people may have moved since the pictures.
        """
        poses = self.pipeline.reconstruction(rays, fresh, detections.skeleton)
        if not len(poses.joints):
            return poses
        if motion > 0.0:
            moved = (motion * self.motion.speed) ** 2
            poses = poses._replace(covariance=poses.covariance + moved[:, None, None] * np.eye(3))
        tracks, count, cameras = self._tracks, len(poses.joints), len(self._sizes)
        new = ~repeats(poses.joints, tracks.state)
        born = Tracks.born(
            poses, ids=np.zeros(count, np.int64), time=now, span=span, speed=self.motion.speed,
            bones=self._bones, cameras=cameras, dimensions=tracks.looks.shape[1],
        )  # fmt: skip
        witnesses = np.zeros(count, np.int64)
        if detections.descriptors is not None and tracks.looks.shape[1]:
            # For comparison; the frame counts with its time when it is known whose it is.
            witnesses = learn_looks(born.looks, born.described, fresh, detections.descriptors, 0.0)
        born = born.select(new)
        back = self.model.reappearance.match(
            born, self._lost, time=now, motion=self.model.motion, trunk=self.motion.trunk, present=tracks,
            witnesses=witnesses[new], scale=scale_of(self.pipeline.affinity),
        )  # fmt: skip
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

    def _pair_with_recent(
        self, rig: Rig, ordered: Detections, lead: Floats, owner: Integers, now: float, span: float
    ) -> tuple[Integers, Integers]:
        """Start tracks of people whom two cameras saw at different times of the latest tenth of a second.

        The owners of detections that get a track are set, (m,).

        Returns:
            Track and camera of each detection of an earlier picture that got a track, (k,) each.
        """
        alone, recent = np.flatnonzero(owner < 0), self._recent
        if not len(alone):
            return alone, alone
        both = recent.beside(ordered.select(alone), ordered.skeleton)
        motion = float(np.abs(np.concatenate([lead[alone], recent.rows["time"] - now])).max())
        chosen, both, rays = enter(rig, both, self.pipeline.duplicates)
        labels = self.pipeline.matching(self.pipeline.affinity(rig, both, rays), number_views(both.view)).labels
        present = chosen < len(alone)
        people, fresh = np.unique(labels[present & (labels >= 0)]), np.full(len(labels), -1)
        of_present = np.isin(labels, people)
        fresh[of_present] = np.searchsorted(people, labels[of_present])
        tracks = np.full(len(labels), -1)
        if len(people):
            self._give_birth(rays, both, fresh, tracks, now, span, motion)
        owner[alone[chosen[present]]] = tracks[present]
        earlier = ~present & (tracks >= 0)
        claimed = np.zeros(len(recent.rows["time"]), np.bool_)
        claimed[chosen[earlier] - len(alone)] = True
        recent.drop(claimed)
        return tracks[earlier], both.view[earlier]

    def _drop(self, now: float, followed: Bools, everyone: bool) -> None:
        """Stop to follow tracks; those who were people may come back."""
        tracks = self._tracks
        if not everyone:
            self._clutter.vanish(now - tracks.born_at[~followed])
            gone = tracks.select(~followed & tracks.reported)
            for others in (tracks, self._lost):
                gone.rival = np.minimum(gone.rival, nearest_rival(gone, others))
            self._lost, self._tracks = self._lost.join(gone), tracks.select(followed)
        if len(self._lost):
            remembered = self.model.reappearance.remembers(self._lost, now)
            if not remembered.all():
                self._lost = self._lost.select(remembered)


def _with_nan(array: Floats, rows: int) -> Floats:
    """Return an array with rows of NaN appended."""
    return np.concatenate([array, np.full((rows, *array.shape[1:]), np.nan)]) if rows else array
