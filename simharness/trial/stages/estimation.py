"""Estimation stage: run every variant of the method on the detections of every frame.

Variants without memory share the frames among all processes, in any order. A variant with memory
(:class:`mvpose.estimators.SequenceEstimator`) gets all frames in order in one process, beside the others.

Inputs of methods: cameras of their own for methods of users, and digests by which a change is noticed.

All variants share the detections of a frame. NumPy protects them from writes in Python only, not from those of C code
or of a tensor that shares their memory.
"""

import contextlib
import copy
import hashlib
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mvpose import Detections, Estimate, Rig
from mvpose.commands.errors import MethodError, RunError, naming_frame
from mvpose.commands.progress import Stages
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.presets import PRESETS, READ_HEATMAPS, without_repair
from simharness.detector.detect import Detected
from simharness.runtime.frame_pool import chunks_of, map_jobs
from simharness.trial.stages.detected_sequence import DetectedSequence

_copies: dict[str, tuple[Rig, Rig]] = {}  # by variant: the last rig, and the copy that the variant has of it


def own_rig(variant: str, rig: Rig) -> Rig:
    """Return a copy of the cameras that no other variant has; the same object in all frames of a rig."""
    original, own = _copies.get(variant, (None, rig))
    if original is not rig:
        own = copy.deepcopy(rig)
        _copies[variant] = (rig, own)
    return own


def input_digest(rig: Rig, detections: Detections) -> bytes:
    """Return a digest of cameras and detections. Heat maps are left out: they are large, and drawn for each frame."""
    digest = hashlib.blake2b(digest_size=16)
    cameras = [array for camera in rig for array in (camera.K, camera.R, camera.t, camera.distortion)]
    cameras += [rig.packed, rig.centers]  # kept by the rig, and read by kernels
    found = (detections.view, detections.keypoints, detections.scores, detections.boxes, detections.box_scores)
    for array in (*cameras, *found, detections.descriptors, detections.time):
        digest.update(b"" if array is None else np.ascontiguousarray(array).data)
    return digest.digest()


@dataclass(frozen=True)
class EstimateFrames:
    """Frame function that runs variants on frames. Heat maps are drawn frame by frame, for variants that read them.

    All variants share the cameras and the detections, so that a change of either is an error.
    """

    rig: Rig
    """The believed cameras."""
    detected: tuple[Detected, ...]
    """All frames."""
    pipelines: Mapping[str, Estimator]
    """Variants by name."""

    def __call__(self, frames: range, variants: Sequence[str] | None = None) -> dict[str, list[Estimate]]:
        """Return the estimates of variants for these frames.

        Args:
            frames: the frames; all of them for variants with memory, because their past begins with the first.
            variants: names; all by default.

        Raises:
            RunError: a variant failed, or has changed what it was given.
        """
        names = tuple(self.pipelines) if variants is None else tuple(variants)
        given = {frame: self._digest(frame) for frame in frames}
        self._warm_up(names, given)
        estimates: dict[str, list[Estimate]] = {name: [] for name in names}
        alone = []
        for name in names:
            estimator = self.pipelines[name]
            if isinstance(estimator, SequenceEstimator):
                estimates[name] = track_frames(estimator, self.rig, self._sequence(name, frames))
                self._check_unchanged(name, given)
            else:
                alone.append(name)
        for frame in frames if alone else ():
            for name, detections in self._inputs(frame, alone):
                with naming_frame(frame):
                    estimates[name].append(self.pipelines[name].estimate(self.rig, detections))
                self._check_unchanged(name, {frame: given[frame]})
        return estimates

    def _digest(self, frame: int) -> bytes:
        return input_digest(self.rig, self.detected[frame].detections)

    def _check_unchanged(self, name: str, given: Mapping[int, bytes]) -> None:
        """Refuse a variant that has changed the cameras, or detections of frames whose digests are given."""
        changed = [frame for frame, digest in given.items() if self._digest(frame) != digest]
        if changed:
            raise MethodError(
                f"frame {changed[0]}: {name} has changed the cameras or the detections that it was given, which all "
                "variants share: nothing after it can be trusted. Let it work on copies"
            )

    def input_of(self, frame: int, variant: str) -> Detections:
        """Return the detections of a frame as a variant gets them, with or without heat maps."""
        return dict(self._inputs(frame, (variant,)))[variant]

    def _inputs(self, frame: int, names: Iterable[str]) -> Iterator[tuple[str, Detections]]:
        mapped = plain = self.detected[frame].detections
        peaks = self.detected[frame].peaks
        if plain.likelihoods is not None:
            plain = replace(plain, likelihoods=None)
        elif peaks is not None and not all(_ignores_heatmaps(name) for name in names):
            mapped = replace(plain, likelihoods=peaks.heatmaps())
        for name in names:
            yield name, plain if _ignores_heatmaps(name) else mapped

    def _sequence(self, variant: str, frames: Iterable[int]) -> Iterator[Detections]:
        """Yield the detections of frames as a variant gets them."""
        return (self.input_of(frame, variant) for frame in frames)

    def _warm_up(self, names: Iterable[str], given: Mapping[int, bytes]) -> None:
        """Run each variant once per process: compilation and loading are no part of the time of a frame.

        Digests of the inputs are given, so that a change is blamed on the variant that made it.
        """
        fresh = [name for name in names if name not in _warm]
        fullest = max(range(len(self.detected)), key=lambda frame: len(self.detected[frame].detections))
        around = range(len(self.detected))[max(fullest - 1, 0) : fullest + 2]
        for name in fresh:
            estimator = self.pipelines[name]
            if isinstance(estimator, SequenceEstimator):
                with contextlib.suppress(RunError):  # if it fails on the recording, too, that error has the right frame
                    track_frames(estimator, self.rig, self._sequence(name, around))
            else:
                with naming_frame(fullest):
                    estimator.estimate(self.rig, self.input_of(fullest, name))
            self._check_unchanged(name, given)
        _warm.update(fresh)


def track_frames(estimator: SequenceEstimator, rig: Rig, frames: Iterable[Detections]) -> list[Estimate]:
    """Return the estimates of all frames of a recording, with the time that each frame took.

    The time of a frame is that between when the estimator takes it and when it takes the next one. The time after the
    last frame is shared equally by the frames that have no estimate by then: by all, of an estimator that reads the
    whole recording first. So smoothing and repair count, and making the detections does not.

    Args:
        estimator: the variant.
        rig: the believed cameras.
        frames: detections of each frame, in the order of time.

    Raises:
        RunError: the estimator failed, or yielded another number of estimates than frames; the message names the frame.
    """
    feed = _TimedFrames(frames)
    estimates: list[Estimate] = []
    online = 0  # estimates that were made before the frames ended
    try:
        for estimate in estimator.track(rig, feed):
            estimates.append(estimate)
            online = online if feed.ended else len(estimates)
    except RunError:
        raise
    except Exception as error:
        raise RunError(f"frame {max(feed.count - 1, 0)}: {type(error).__name__}: {error}") from error
    feed.finish(online)
    count = feed.count + sum(1 for _ in feed)
    if len(estimates) != count:
        raise MethodError(
            f"frame {min(len(estimates), count)}: track yielded {len(estimates)} estimates for {count} frames, "
            "expected one for each frame, in order"
        )
    return [
        replace(each, timings={**each.timings, "total": seconds})
        for each, seconds in zip(estimates, feed.seconds, strict=True)
    ]


def estimate_variants(
    detected: DetectedSequence,
    pipelines: Mapping[str, Estimator],
    stages: Stages,
    *,
    known: Mapping[str, Sequence[Estimate]],
    workers: int = 1,
) -> dict[str, tuple[Estimate, ...]]:
    """Return the estimates of all variants for all frames.

    Args:
        detected: the detections.
        pipelines: variants by name.
        stages: timer and reporter of the stage ``estimate``.
        known: estimates of variants that need not run again.
        workers: number of processes that share the frames; a variant with memory takes one for all frames. Results do
            not depend on it.
    """
    missing = {name: pipeline for name, pipeline in pipelines.items() if name not in known}
    estimates = {name: tuple(frames) for name, frames in known.items()}
    if missing:
        indices = range(len(detected.frames))
        tracking = [name for name, each in missing.items() if isinstance(each, SequenceEstimator)]
        alone = [name for name in missing if name not in tracking]
        jobs: list[tuple[range, list[str]]] = [(indices, [name]) for name in tracking]
        if alone:
            jobs += [(chunk, alone) for chunk in chunks_of(indices, workers)]
        with stages.stage("estimate", sum(len(frames) for frames, _ in jobs)) as advance:
            estimation = EstimateFrames(detected.rig, detected.frames, missing)
            parts = map_jobs(estimation, jobs, workers=workers, progress=advance)
        estimates |= {name: tuple(each for part in parts for each in part.get(name, ())) for name in missing}
    return {name: estimates[name] for name in pipelines}


_warm: set[str] = set()  # variants that this process has run


def _ignores_heatmaps(variant: str) -> bool:
    return without_repair(variant) in PRESETS.keys() - READ_HEATMAPS


class _TimedFrames(Iterator[Detections]):
    """Frames that an estimator takes one after the other, with the time that it spends on each.

    Attributes:
        seconds: time spent on each frame that was taken.
        ended: whether the estimator has found that there is no further frame.
    """

    def __init__(self, frames: Iterable[Detections]) -> None:
        self._frames = iter(frames)
        self._since = 0.0
        self.seconds: list[float] = []
        self.ended = False

    @property
    def count(self) -> int:
        """Number of frames that were taken."""
        return len(self.seconds)

    def __next__(self) -> Detections:
        if self.ended:
            raise StopIteration
        if self.seconds:
            self.seconds[-1] += time.perf_counter() - self._since
        try:
            detections = next(self._frames)
            self.seconds.append(0.0)
        except StopIteration:
            self.ended = True
            raise
        finally:
            self._since = time.perf_counter()
        return detections

    def finish(self, online: int) -> None:
        """Share the time since the last frame was taken, or since there was none, by the frames that waited for it.

        Args:
            online: number of frames that had their estimates before; the others share, or the last if there are none.
        """
        rest = time.perf_counter() - self._since
        waited = range(max(min(online, self.count - 1), 0), self.count)
        for index in waited:
            self.seconds[index] += rest / len(waited)
