"""Online tracker: the stages of a pipeline frame by frame, with the people of the past as one more party.

A frame goes through prediction, affinity, matching, update, birth and existence. The frame of a tracker without a past
gives the people of the pipeline.
"""

import math
import time as clock
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import seal
from mvpose.detections import Detections
from mvpose.estimate import Estimate, Matching
from mvpose.ordering import number_views
from mvpose.pipeline import Pipeline, prepare_rays
from mvpose.rays import Rays
from mvpose.reconstruction.error_scale import SHARED
from mvpose.reconstruction.poses import Poses
from mvpose.skeleton import Skeleton
from mvpose.tracking.association import TrackingModel
from mvpose.tracking.births import Births
from mvpose.tracking.bones import BonePrior, bone_prior
from mvpose.tracking.drift_watch import CameraResiduals, Drift, DriftWatch
from mvpose.tracking.existence import MeasuredClutter
from mvpose.tracking.frame_kernels import judge_tracks, predict_tracks, report_tracks, update_tracks
from mvpose.tracking.motion import JointMotion
from mvpose.tracking.picture_shift import ExpectedPeople
from mvpose.tracking.picture_times import FrameClock, FrameTimes, readouts, undo_rolling
from mvpose.tracking.pose_update import MatchedRays, place_people, repetition
from mvpose.tracking.reappearance import Population, learn_looks
from mvpose.tracking.recent_pictures import RecentPictures
from mvpose.tracking.state import TrackerState, check_serves, layout, of_tracks
from mvpose.tracking.tracks import Moment, Tracks

_FORGETTING = 0.5  # seconds: time constant of the score of a joint that no view supports


class _Frame(NamedTuple):
    """Detections of a frame that take part, in the canonical order."""

    chosen: Integers
    """Their indices, (m,)."""
    ordered: Detections
    """The detections."""
    rays: Rays
    """Their viewing rays."""
    lead: Floats
    """Time from the frame to the picture of each, (m,), seconds."""
    times: FrameTimes
    """Times of the frame and its pictures."""


class _Sightings(NamedTuple):
    """Detections that show tracks, of this frame and of earlier pictures that met their partners in it."""

    owner: Integers
    """Track of each of the m detections of the frame, (m,), or -1."""
    shown_by: Integers
    """The same of all k detections, (k,)."""
    in_view: Integers
    """Their cameras, (k,)."""
    poses: Poses | None
    """Poses of newcomers; None where nobody came."""
    since: Floats
    """Time from the previous picture of each camera, (V,), seconds."""


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

    @property
    def residuals(self) -> CameraResiduals | None:
        """How well each camera agrees with the others in the latest seconds; None before the first frame."""
        return None if self._layout is None else self._watch.residuals

    @property
    def drifts(self) -> tuple[Drift, ...]:
        """Cameras that have moved since the first minute, the first one found first.

        A rig of two cameras has none: neither is known to be right.
        """
        return () if self._rig is None else self._watch.drifts(self._rig)

    def advance(self, rig: Rig, detections: Detections, *, keep: bool = False) -> Moment:
        """Take the next frame, without an estimate; see :meth:`estimate`.

        Args:
            rig: calibrated cameras.
            detections: detections of the frame.
            keep: whether the moment is still needed after the next frame; else it shares memory with the tracker.
        """
        start = clock.perf_counter()
        first = not self._clock.started
        frame = self._prepare(rig, detections)
        times, ordered = frame.times, frame.ordered
        affinity = self.pipeline.affinity(rig, ordered, frame.rays)
        if ordered.descriptors is not None:
            self._people.see_looks(ordered.descriptors.shape[1])
        self._clock.take(times)
        before = self._predict(times, keep)
        count, tracks = len(self._people.tracks), self._people.tracks
        joined, views = self.model.affinity.join(
            affinity, number_views(ordered.view), frame.rays, tracks.state, tracks.covariance, frame.lead
        )
        compared = clock.perf_counter()
        labels = self.pipeline.matching(joined, views).labels
        matched = clock.perf_counter()
        sightings = self._update(rig, frame, labels, first)
        odds, presence, shown, followed, all_followed = self._judge(rig, frame, sightings, count, first)
        tracks = self._people.tracks
        if before is not None:
            new = len(tracks) - count
            tracks, before = tracks.snapshot(), (_with_nan(before[0], new), _with_nan(before[1], new))
        moment = Moment(
            time=times.now,
            elapsed=times.elapsed,
            tracks=tracks,
            predicted=before,
            odds=odds,
            presence=presence,
            shown=shown,
            owner=sightings.owner,
            chosen=frame.chosen,
            detections=len(detections),
            poses=sightings.poses if first else None,
            timings={},
        )
        self._drop(times.now, followed, all_followed)
        end = clock.perf_counter()
        moment.timings.update(
            affinity=compared - start, matching=matched - compared, reconstruction=end - matched, total=end - start
        )
        return moment

    def _prepare(self, rig: Rig, detections: Detections) -> _Frame:
        """Return the detections that take part; refuse bad ones, and leave the tracker as it was then."""
        chosen, ordered, rays = prepare_rays(rig, detections, self.pipeline.duplicates)
        if rig is not self._rig or detections.skeleton is not self._skeleton:
            self._bind(rig, detections.skeleton)
        times = self._clock.read(detections, len(rig))
        if times.too_old:
            kept = times.pictures[ordered.view]
            chosen, ordered, rays = chosen[kept], ordered.select(kept), rays.select(kept)
        return _Frame(chosen, ordered, rays, times.lead[ordered.view], times)

    def _predict(self, times: FrameTimes, keep: bool) -> tuple[Floats, Floats] | None:
        """Carry all tracks to the time of the frame; return states and covariances there if they are to be kept."""
        tracks, vague = self._people.tracks, self.model.existence.vague
        known, all_known = predict_tracks(tracks.state, tracks.covariance, times.elapsed, *self.motion, 2.0 * vague)
        self._drop(times.now, known, all_known)
        tracks = self._people.tracks
        return (tracks.state.copy(), tracks.covariance.copy()) if keep else None

    def _update(self, rig: Rig, frame: _Frame, labels: Integers, first: bool) -> _Sightings:
        """Update tracks by the detections that were matched with them, and start those of newcomers.

        Args:
            rig: cameras.
            frame: the m detections.
            labels: groups of the detections and of the n tracks, (m + n,), or -1.
            first: whether the frame is the first.
        """
        model, people, times, ordered, lead = self.model, self._people, frame.times, frame.ordered, frame.lead
        tracks, noise, m = people.tracks, model.noise, len(ordered)
        labels, groups = labels[:m], labels[m:]
        rays = self._undo_rolling_shutter(ordered, frame.rays, labels, groups)
        matched = MatchedRays(labels, rays.view, rays.origins, rays.directions, rays.weights, rays.pixel, lead)
        self._watch.take(
            matched, ExpectedPeople(groups, tracks.reported, tracks.state), now=times.now, pictures=times.pictures,
            sigmas=self._sigmas, cameras=rig.packed, sizes=self._sizes,
        )  # fmt: skip
        placed = place_people(
            self.pipeline.reconstruction, rays, ordered.skeleton, labels, groups, lead,
            factor=repetition(times.elapsed, model.correlation),
        )  # fmt: skip
        owner, fresh, newcomers = update_tracks(
            tracks.poses, groups, matched._replace(pixel=noise.pixels * rays.pixel), self._sigmas, noise.floor,
            self.motion, placed, self._bones.ends, times.elapsed, float(np.exp(-times.elapsed / _FORGETTING)),
        )  # fmt: skip
        since = self._recent.take(times.now, times.lead, times.pictures)
        poses, shown_by, in_view = None, owner, ordered.view
        if newcomers or first:
            poses = self._births.give_birth(rays, ordered, fresh, owner, now=times.now, span=self._span(times, since))
        if self._recent.wait_for(times.now, times.pictures):
            partners, cameras = self._births.pair_with_recent(
                self._recent, rig, ordered, lead, owner, now=times.now, span=self._span(times, since)
            )
            shown_by, in_view = np.concatenate([owner, partners]), np.concatenate([in_view, cameras])
        self._recent.add(ordered, owner < 0)
        return _Sightings(owner, shown_by, in_view, poses, since)

    def _span(self, times: FrameTimes, since: Floats) -> float:
        """Return the time in which newcomers may have come, seconds."""
        return self.model.existence.span(float(since.min(where=times.pictures, initial=np.inf)))

    def _judge(
        self, rig: Rig, frame: _Frame, sightings: _Sightings, count: int, first: bool
    ) -> tuple[Floats, Floats, Bools, Bools, bool]:
        """Decide who is a person, who is present, and who is followed further, by what the pictures show.

        Args:
            rig: cameras.
            frame: the detections.
            sightings: their tracks.
            count: number of tracks before the newcomers.
            first: whether the frame is the first.

        Returns:
            As :func:`mvpose.tracking.frame_kernels.judge_tracks`, without the false detections, which are counted.
        """
        tracks, times, existence, clutter = self._people.tracks, frame.times, self.model.existence, self._clutter
        if frame.ordered.descriptors is not None:
            learn_looks(tracks.looks, tracks.described, sightings.owner, frame.ordered.descriptors, times.elapsed)
        *verdict, false = judge_tracks(
            tracks.state, tracks.covariance, tracks.span, tracks.origin, tracks.hits, tracks.misses, tracks.absent,
            tracks.found, tracks.anchor, tracks.moved, tracks.reported, len(tracks) - count, sightings.shown_by,
            sightings.in_view, rig.packed, self._sizes, times.pictures, sightings.since, *existence.correlation,
            clutter.density, clutter.flashes, existence.rates, existence.presence, times.now, existence.vague, first,
        )  # fmt: skip
        clutter.count(false, times.pictures, sightings.since, times.elapsed)
        return tuple(verdict)

    def report(self, moment: Moment) -> Estimate:
        """Return the estimate of a moment."""
        start = clock.perf_counter()
        tracks = moment.tracks
        joints, covariance, scores, labels = report_tracks(
            moment.shown, tracks.poses, self._bones.ends, SHARED * self._sigmas, moment.owner, moment.chosen,
            moment.detections,
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
        now, clutter, people = self._clock, self._clutter, self._people
        return TrackerState(
            {
                **self._layout,
                "clock": np.array([now.interval, now.time, now.pictured, now.dark]),
                "born": np.array([people.born]),
                "density": clutter.density,
                "watched": clutter.watched,
                "clutter": clutter.counts,
                **of_tracks(people.tracks, people.lost),
                **{f"recent.{name}": array for name, array in self._recent.state().items()},
                **{f"drift.{name}": array for name, array in self._watch.state().items()},
            }
        )

    @classmethod
    def restored(
        cls, state: TrackerState, pipeline: Pipeline | None = None, *, model: TrackingModel | None = None
    ) -> Self:
        """Return a tracker that goes on where another one was.

        Args:
            state: of the other tracker.
            pipeline: stages of one frame; those of the other tracker for the same estimates.
            model: settings; those of the other tracker for the same estimates.
        """
        tracker, arrays = cls(pipeline, model=model), state.arrays
        tracker._layout = {name: arrays[name] for name in arrays if name.startswith(("version", "rig.", "skeleton."))}
        tracker._clock = FrameClock(tracker.model.period, *map(float, arrays["clock"]))
        tracker._clutter = MeasuredClutter(tracker.model.existence, len(arrays["density"]))
        tracker._clutter.density, tracker._clutter.counts = arrays["density"].copy(), arrays["clutter"].copy()
        tracker._clutter.watched = arrays["watched"].copy()
        tracker._people = Population(state.group("tracks"), state.group("lost"), int(arrays["born"][0]))
        tracker._recent = RecentPictures.restored(state.recent)
        tracker._watch = DriftWatch.restored(tracker.model.drift, state.drift)
        return tracker

    def _bind(self, rig: Rig, skeleton: Skeleton) -> None:
        """Start with a rig and a skeleton; refuse others in later frames."""
        bones = bone_prior(skeleton)
        if self._layout is None:
            self._layout = layout(rig, skeleton)
            self._clutter = MeasuredClutter(self.model.existence, len(rig))
            self._recent = RecentPictures(len(rig), len(skeleton))
            self._watch = DriftWatch(self.model.drift, len(rig))
            nobody = Tracks.none(joints=len(skeleton), bones=len(bones.length), cameras=len(rig))
            self._people = Population(nobody, nobody)
        else:
            check_serves(self._layout, rig, skeleton)
        self._rig, self._skeleton = rig, skeleton
        self._sizes = np.array([camera.size for camera in rig], float)
        self._readout = readouts(rig)
        self.motion: JointMotion = self.model.motion.of_joints(skeleton)
        self._bones: BonePrior = bones
        self._sigmas = self.model.noise.sigmas(skeleton)
        self._births = Births(
            self._people, self.pipeline, returns=self.model.reappearance, motion=self.model.motion,
            of_joints=self.motion, newcomers=self.model.motion.of_newcomers(skeleton), bones=bones, cameras=len(rig),
        )  # fmt: skip

    def _undo_rolling_shutter(self, ordered: Detections, rays: Rays, labels: Integers, groups: Integers) -> Rays:
        """Return viewing rays as if all rows of a picture were exposed at once."""
        if self._readout is None:
            return rays
        directions = undo_rolling(
            self._readout, ordered.view, ordered.keypoints, rays.origins, rays.directions, rays.weights, labels,
            groups, self._people.tracks.state,
        )  # fmt: skip
        return Rays(rays.view, rays.origins, directions, rays.weights, rays.pixel, rays.modes)

    def _drop(self, now: float, followed: Bools, everyone: bool) -> None:
        """Stop to follow tracks; those who were people may come back."""
        self._people.settle()
        if not everyone:
            self._clutter.vanish(now - self._people.keep(followed))
        self._people.forget(now, self.model.reappearance)


def _with_nan(array: Floats, rows: int) -> Floats:
    """Return an array with rows of NaN appended."""
    return np.concatenate([array, np.full((rows, *array.shape[1:]), np.nan)]) if rows else array
