"""People of a recording: the estimator over all frames, and the check that the people agree with their detections.

A wrong calibration, exchanged cameras or another picture size still give people, confident ones; but these miss the
keypoints from which they were made, which needs no truth to see.

Short examination of the calibration of every recording that is estimated: the doctor on some of its frames.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.findings import Diagnosis
from mvpose.camera import Rig
from mvpose.cli.inputs import Inputs
from mvpose.commands.errors import failing
from mvpose.commands.programs import note
from mvpose.commands.progress import single_stage
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.estimators import Estimator, SequenceEstimator
from mvpose.files.message_text import listed
from mvpose.formats.people.people_parts import FRAMES, PeopleParts
from mvpose.presets import NEED_DESCRIPTORS, PRESETS, preset
from mvpose.report.verdict import sentence
from mvpose.skeleton import COCO17
from mvpose.tracking.smoothing import TrackingPipeline, track
from mvpose.tracking.state import TrackerState
from mvpose.tracking.tracker import Tracker
from mvpose.wholebody import body_of, body_part, whole_body

MOST_FRAMES = 100
"""Frames that are examined, of twelve seconds at most: about two seconds of computing."""

_SPACING = 0.12  # s: largest time between examined frames, in which people are still followed


def examine(inputs: Inputs) -> Diagnosis | None:
    """Ask the doctor about some frames, and print the verdict; None where the examination failed.

    Its failure is no failure of the estimation.
    """
    from mvpose.calibration import diagnose

    rows, step = examined_frames(inputs.frames, period=inputs.period)
    frames = [body_part(inputs.frames[row]) for row in rows.tolist()]
    try:
        diagnosis = diagnose(inputs.rig, frames, period=step * inputs.period)
    except Exception as error:
        note(f"the calibration was not examined ({type(error).__name__}: {error}); `mvpose doctor` examines it alone")
        return None
    mend = " `mvpose doctor` says what mends it" if diagnosis.alarms else ""
    verdict = f"calibration, by {len(rows)} of {len(inputs.frames)} frames: {sentence(diagnosis)}{mend}"
    note(verdict, usual=not diagnosis.alarms)
    return diagnosis


def examined_frames(frames: Sequence[Detections], *, period: float) -> tuple[np.ndarray, int]:
    """Return the rows of at most :data:`MOST_FRAMES` frames, and the step between them.

    They are as far apart as people can be followed, and where most is detected.

    Args:
        frames: detections of all frames.
        period: time between frames, seconds.
    """
    step = max(1, min(int(_SPACING / period + 1e-9), -(-len(frames) // MOST_FRAMES)))
    rows = np.arange(0, len(frames), step)
    counts = np.concatenate([[0], np.cumsum([len(frames[row]) for row in rows.tolist()])])
    width = min(MOST_FRAMES, len(rows))
    first = int(np.argmax(counts[width:] - counts[: len(counts) - width]))
    return rows[first : first + width], step


GOOD = 0.57
"""Residual below which a keypoint is good, in standard deviations of annotators: OKS 0.85 (Ronchi, ICCV 2017)."""

MISS = 1.18
"""Residual above which a keypoint is missed: OKS 0.5, the loosest threshold of COCO's evaluation."""


_COMPARED = 3000  # frames of which people are compared with their detections; of longer recordings every n-th
_SEEN = 0.3  # score above which a keypoint counts: those below are guesses of the detector
_AREA = 0.53  # of a box that a person covers, as in COCO's evaluation without masks
_FEWEST = 30  # keypoints of a camera from which a median is known
_FEW = 10  # people whose postures count
_MOST = 0.75  # share of people who stand or face wrongly from which the axis is wrong, not their posture
_APART = 0.05  # share of a camera's detections in people below which it sees other people than the others
_BODIES = (0.4, 2.2)  # metres from shoulder to ankle, along the bones: from a baby to beyond the tallest
_LONG = ((5, 11), (11, 13), (13, 15), (6, 12), (12, 14), (14, 16))  # trunk, thigh and shank of both sides in COCO-17


def estimator(method: str, *, lag: float, period: float) -> Estimator:
    """Return the preset of a name.

    Raises:
        ValueError: an unknown name, one that needs descriptors, which files of detections do not have, or a bad lag.
    """
    if method in NEED_DESCRIPTORS:
        raise ValueError(f"--method {method}: needs descriptors, which files of detections do not hold; use track")
    if method not in PRESETS:
        known = [name for name in PRESETS if name not in NEED_DESCRIPTORS]
        raise ValueError(f"--method {method}: no such method; expected one of {', '.join(known)}")
    if not lag >= 0.0 or math.isnan(lag):
        raise ValueError(f"--lag must be 0 s or more, or inf, got {lag}")
    return preset(method, lag=lag, period=period)


def estimate_people(inputs: Inputs, method: Estimator, folder: Path, *, trust: bool = False) -> PeopleParts:
    """Estimate the people of all frames, and write them in parts; an interrupted estimation goes on from its parts.

    Args:
        inputs: the recording.
        method: one of :func:`estimator`; one without memory numbers the people of each frame anew.
        folder: an existing folder for the parts: empty, or that of an interrupted estimation of the same.
        trust: accept people who contradict their detections.

    Raises:
        ValueError: people who contradict their detections, :func:`mvpose.cli.estimation.check`.
        RunError: the estimator failed.
        OSError: the folder cannot be written.
    """
    parts = PeopleParts(folder, inputs.skeleton, inputs.period, tracked=isinstance(method, SequenceEstimator))
    total = len(inputs.frames)
    if parts.frames and parts.frames < total and not _state_file(folder, parts.frames).is_file():
        parts = parts.emptied()
    if done := parts.frames:
        note(f"goes on from frame {done} of {total}, where an earlier run was interrupted", usual=True)
    with single_stage("estimate", total, done=done) as advance:
        batch: list[Estimate] = []
        for estimate, save_state in _estimates(inputs, method, folder, done):
            batch.append(estimate)
            advance(1)
            if len(batch) == FRAMES or done + len(batch) == total:
                rows = [k for k in range(done, done + len(batch)) if k % (-(-total // _COMPARED)) == 0]
                compared = [batch[k - done] for k in rows]
                extra = evidence(inputs.rig, [inputs.frames[k] for k in rows], compared)
                done += len(batch)
                if done < total:
                    save_state(done)
                parts.add(batch, extra)
                batch = []
                if len(parts.extras) == 1 and not trust:
                    contradictions(inputs, parts.extras)  # before hours of work
    try:
        remarks = contradictions(inputs, parts.extras)
    except ValueError as error:
        if not trust:
            raise
        remarks = [str(error)]
    else:
        remarks += ["--trust has no effect: nothing contradicts the people"] if trust else []
    for remark in remarks:
        note(remark)
    return parts


@dataclass(frozen=True)
class _Following:
    """A tracker that goes on where it is; the protocol is that of :class:`mvpose.estimators.SequenceEstimator`."""

    tracker: Tracker
    lag: float

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate one frame alone."""
        return self.tracker.pipeline.estimate(rig, detections)

    def track(self, rig: Rig, frames: Iterable[Detections]) -> Iterator[Estimate]:
        """Yield the estimates of the next frames."""
        return track(self.tracker, rig, frames, lag=self.lag)


def _estimates(
    inputs: Inputs, method: Estimator, folder: Path, done: int
) -> Iterator[tuple[Estimate, Callable[[int], None]]]:
    """Yield the estimates of all frames from ``done`` on, and a function that saves the tracker before a later frame.

    Its file is what another run needs to go on there with the same bytes. Estimates of a lag that has not passed are no
    part of it: they come again.
    """
    if done == len(inputs.frames):
        return
    tracker: Tracker | None = None
    states: dict[int, TrackerState] = {}
    if isinstance(method, TrackingPipeline):
        tracker = Tracker(method.pipeline, model=method.model)
        if done:
            state = TrackerState.load(_state_file(folder, done))
            tracker = Tracker.restored(state, method.pipeline, model=method.model)
        method = _Following(tracker, method.lag)
    method = whole_body(method) if inputs.skeleton != COCO17 else method

    def frames() -> Iterator[Detections]:
        for row in range(done, len(inputs.frames)):
            if tracker is not None and row > done and row % FRAMES == 0:
                states[row] = tracker.state()
            yield inputs.frames[row]

    def save_state(row: int) -> None:
        if tracker is not None:
            (states.pop(row, None) or tracker.state()).save(_state_file(folder, row))
        elif not isinstance(method, SequenceEstimator):
            _state_file(folder, row).touch()

    results = (
        method.track(inputs.rig, frames())
        if isinstance(method, SequenceEstimator)
        else (method.estimate(inputs.rig, frame) for frame in frames())
    )
    while True:
        with failing("estimation"):
            if (estimate := next(results, None)) is None:
                return
        yield estimate, save_state


def _state_file(folder: Path, row: int) -> Path:
    return folder / f"before-{row:08d}.npz"


def contradictions(inputs: Inputs, extras: Sequence[Mapping[str, Floats]]) -> list[str]:
    """Return remarks about people who agree with their detections loosely, or whom no posture explains.

    Args:
        inputs: the recording.
        extras: :func:`evidence` of some frames.

    Raises:
        ValueError: as :func:`check` and :func:`check_postures`.
    """
    joined = {key: np.concatenate([each[key] for each in extras]) for key in (extras[0] if extras else ())}
    if not joined:
        return []
    return [*check(inputs.rig, agreement(inputs.rig, joined)), *check_postures(joined["bodies"], inputs.doubt)]


@dataclass(frozen=True)
class Agreement:
    """Agreement of people with the detections of every camera."""

    residuals: Floats
    """Median distance of keypoints from the projected joints, (V,), in standard deviations of annotators (twice OKS's
    sigma times the root of the person's area); NaN where there are too few."""
    shares: Floats
    """Share of the detections that belong to a person whom other cameras see, too, (V,); NaN without any."""
    body: float
    """Median length from shoulder to ankle, metres; NaN where nobody is complete."""


def evidence(rig: Rig, frames: Sequence[Detections], estimates: Sequence[Estimate]) -> dict[str, Floats]:
    """Return what :func:`agreement` and :func:`check_postures` need of some frames, by name.

    That is ``bodies``, the people on COCO-17 (n, 17, 3); ``seen``, for each detection its camera and whether it belongs
    to a person, (m, 2); and ``residuals``, (m, 17), NaN for those that belong to nobody.
    """
    bodies, seen, residuals = ([np.zeros((0, *shape))] for shape in ((17, 3), (2,), (17,)))
    for whole, estimate in zip(frames, estimates, strict=True):
        frame, people = body_part(whole), body_of(estimate, whole.skeleton)
        labels = people.matching.labels_of(len(frame))
        rows = np.flatnonzero(labels >= 0)
        seen.append(np.column_stack([frame.view, labels >= 0]))
        residuals.append(np.full((len(frame), 17), np.nan))
        if len(people):
            residuals[-1][rows] = _residuals(rig, frame, people, rows, labels[rows])
            bodies.append(people.joints)
    return {"bodies": np.concatenate(bodies), "seen": np.concatenate(seen), "residuals": np.concatenate(residuals)}


def agreement(rig: Rig, found: Mapping[str, Floats]) -> Agreement:
    """Measure the agreement of people with their detections, given :func:`evidence`."""
    view, matched = found["seen"].astype(int).T
    counts = np.bincount(view, minlength=len(rig))
    shares = np.where(counts > 0, np.bincount(view, matched, len(rig)) / np.maximum(counts, 1), np.nan)
    medians = [_median(found["residuals"][view == k]) for k in range(len(rig))]
    return Agreement(np.array(medians), shares, _median(_lengths(found["bodies"]), fewest=1))


def check(rig: Rig, agreed: Agreement) -> list[str]:
    """Return remarks about people who agree with their detections loosely.

    Raises:
        ValueError: cameras whose keypoints the people miss, or bodies of impossible size.
    """
    mend = "`mvpose doctor` tells what is wrong; --trust writes these people nevertheless"
    if np.isfinite(agreed.body) and not _BODIES[0] < agreed.body < _BODIES[1]:
        raise ValueError(
            f"the people measure {agreed.body:.2g} m from shoulder to ankle, expected {_BODIES[0]} to {_BODIES[1]} m: "
            f"the translations of the calibration are not in metres (--unit states what they are in); {mend}"
        )
    wrong = [k for k in range(len(rig)) if agreed.residuals[k] > MISS]
    if wrong:
        raise ValueError(
            "the calibration contradicts the detections: people miss the keypoints from which they were made, in "
            f"camera {_with_residuals(rig, agreed, wrong)} times the spread of annotators (expected below {GOOD}). "
            f"Check which detections belong to which camera, the picture size, units and conventions; {mend}"
        )
    remarks = []
    loose = [k for k in range(len(rig)) if agreed.residuals[k] > GOOD]
    if loose:
        remarks.append(
            f"people miss the keypoints of camera {_with_residuals(rig, agreed, loose)} times the spread of annotators "
            f"(expected below {GOOD}): errors are larger than the covariances say; `mvpose doctor` tells why"
        )
    apart = [rig[k].name for k in range(len(rig)) if agreed.shares[k] < _APART]
    if apart:
        remarks.append(
            f"no other camera sees the people of camera {listed(apart)}, which therefore adds nothing: it looks "
            "elsewhere, its detections are of another camera or time, or it has moved; `mvpose doctor` tells which"
        )
    return remarks


def check_postures(joints: Floats, doubt: str) -> list[str]:
    """Return remarks about people whose bodies no posture explains.

    Args:
        joints: people of all frames on COCO-17, (n, 17, 3), metres, z up; NaN where missing.
        doubt: why the upward axis may be wrong.

    Raises:
        ValueError: people who lie where the upward axis is in doubt, or whose left is on their right.
    """
    nose, ears = joints[:, 0], joints[:, 3:5].mean(axis=1)
    shoulders, hips = joints[:, 5:7].mean(axis=1), joints[:, 11:13].mean(axis=1)
    trunk = shoulders - hips
    handed = np.einsum("nk,nk->n", joints[:, 5] - joints[:, 6], np.cross(trunk, nose - ears))
    handed = handed[np.isfinite(handed)]
    if len(handed) >= _FEW and (handed < 0).mean() > _MOST:
        raise ValueError(
            f"left and right of {100 * (handed < 0).mean():.0f} % of the people are exchanged, by their noses: the "
            "names of the joints are in another order (--skeleton), or the pictures are mirrored; `mvpose doctor` "
            "tells which; --trust writes these people nevertheless"
        )
    trunk = trunk[np.isfinite(trunk).all(axis=1)]
    lie = trunk[:, 2] < 0.5 * np.linalg.norm(trunk, axis=1)  # more than 60 degrees from upright
    if len(lie) < _FEW or lie.mean() < _MOST:
        return []
    if doubt:
        raise ValueError(f"{doubt}, and the people lie on their sides: correct --up; --trust writes them nevertheless")
    return [f"{100 * lie.mean():.0f} % of the people lie: if they stand, another axis points up (--up)"]


def _with_residuals(rig: Rig, agreed: Agreement, views: Sequence[int]) -> str:
    return listed([f"{rig[k].name} by {agreed.residuals[k]:.2g}" for k in views])


def _residuals(rig: Rig, frame: Detections, estimate: Estimate, rows: Integers, people: Integers) -> Floats:
    """Return the residual of every keypoint of some detections, (n, J); NaN for those that do not count."""
    projected = rig.project(estimate.joints)[frame.view[rows], people]
    distance = np.linalg.norm(projected - frame.keypoints[rows], axis=-1)
    area = _AREA * frame.boxes[rows, 2] * frame.boxes[rows, 3]
    spread = np.sqrt(np.maximum(area, 1.0))[:, None] * np.sqrt(frame.skeleton.variances)
    return np.where(frame.scores[rows] > _SEEN, distance / spread, np.nan)


def _lengths(joints: Floats) -> Floats:
    """Return the length from shoulder to ankle of each person, mean of both sides, (n,), metres."""
    bones = [np.linalg.norm(joints[:, a] - joints[:, b], axis=-1) for a, b in _LONG]
    return np.sum(bones, axis=0) / 2.0


def _median(values: Floats, fewest: int = _FEWEST) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) >= fewest else float("nan")
