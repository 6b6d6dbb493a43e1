"""People of a recording: the estimator over all frames, and the check that the people agree with their detections.

A wrong calibration, exchanged cameras or another picture size still give people, confident ones; but these miss the
keypoints from which they were made, which needs no truth to see.

Short examination of the calibration of every recording that is estimated: the doctor on some of its frames.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

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
from mvpose.presets import NEED_DESCRIPTORS, PRESETS, preset
from mvpose.recording import People
from mvpose.report.verdict import sentence
from mvpose.skeleton import COCO17
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
    note(f"calibration, by {len(rows)} of {len(inputs.frames)} frames: {_verdict(diagnosis)}")
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


def _verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict as one line."""
    return sentence(diagnosis) + (" `mvpose doctor` says what mends it" if diagnosis.alarms else "")


GOOD = 0.57
"""Residual below which a keypoint is good, in standard deviations of annotators: OKS 0.85 (Ronchi, ICCV 2017)."""

MISS = 1.18
"""Residual above which a keypoint is missed: OKS 0.5, the loosest threshold of COCO's evaluation."""


_SEEN = 0.3  # score above which a keypoint counts: those below are guesses of the detector
_AREA = 0.53  # of a box that a person covers, as in COCO's evaluation without masks
_FEWEST = 30  # keypoints of a camera from which a median is known
_FEW = 10  # people whose postures count
_MOST = 0.75  # share of people who stand or face wrongly from which the axis is wrong, not their posture
_APART = 0.05  # share of a camera's detections in people below which it sees other people than the others
_BODIES = (0.4, 2.2)  # metres from shoulder to ankle, along the bones: from a baby to beyond the tallest
_LONG = ((5, 11), (11, 13), (13, 15), (6, 12), (12, 14), (14, 16))  # trunk, thigh and shank of both sides in COCO-17


def check_method(method: str, *, lag: float) -> None:
    """Check the name of a method and the lag.

    Raises:
        ValueError: as :func:`estimator`.
    """
    estimator(method, lag=lag, period=1.0)


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


def estimate_people(inputs: Inputs, method: Estimator, *, trust: bool = False) -> People:
    """Estimate the people of all frames.

    Args:
        inputs: the recording.
        method: one of :func:`estimator`; one without memory numbers the people of each frame anew.
        trust: accept people who contradict their detections.

    Raises:
        ValueError: people who contradict their detections, :func:`mvpose.cli.estimation.check`.
        RunError: the estimator failed.
    """
    estimates = []
    method = whole_body(method) if inputs.skeleton != COCO17 else method
    tracks = isinstance(method, SequenceEstimator)
    with single_stage("estimate", len(inputs.frames)) as advance, failing("estimation"):
        results = (
            method.track(inputs.rig, inputs.frames)
            if isinstance(method, SequenceEstimator)
            else (method.estimate(inputs.rig, frame) for frame in inputs.frames)
        )
        for estimate in results:
            estimates.append(estimate)
            advance(1)
    try:
        bodies = [body_of(each, inputs.skeleton) for each in estimates]
        remarks = check(inputs.rig, agreement(inputs.rig, [body_part(frame) for frame in inputs.frames], bodies))
        remarks += check_postures(
            np.concatenate([np.zeros((0, 17, 3)), *(each.joints for each in bodies)]), inputs.doubt
        )
    except ValueError as error:
        if not trust:
            raise
        remarks = [str(error)]
    else:
        remarks += ["--trust has no effect: nothing contradicts the people"] if trust else []
    for remark in remarks:
        note(remark)
    return People.of_estimates(estimates, inputs.skeleton, inputs.period, untracked=not tracks)


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


def agreement(rig: Rig, frames: Sequence[Detections], estimates: Sequence[Estimate]) -> Agreement:
    """Measure the agreement of the people of all frames with their detections."""
    found: list[tuple[Integers, Floats]] = []
    counts, matched = np.zeros(len(rig)), np.zeros(len(rig))
    bodies = []
    for frame, estimate in zip(frames, estimates, strict=True):
        labels = estimate.matching.labels_of(len(frame))
        counts += np.bincount(frame.view, minlength=len(rig))
        rows = np.flatnonzero(labels >= 0)
        matched += np.bincount(frame.view[rows], minlength=len(rig))
        if len(estimate):
            found.append((frame.view[rows], _residuals(rig, frame, estimate, rows, labels[rows])))
            bodies.append(_lengths(estimate.joints))
    shares = np.where(counts > 0, matched / np.maximum(counts, 1), np.nan)
    if not found:
        return Agreement(np.full(len(rig), np.nan), shares, float("nan"))
    view, residual = (np.concatenate(each) for each in zip(*found, strict=True))
    medians = [_median(residual[view == k]) for k in range(len(rig))]
    return Agreement(np.array(medians), shares, _median(np.concatenate(bodies), fewest=1))


def check(rig: Rig, agreed: Agreement) -> list[str]:
    """Return remarks about people who agree with their detections loosely.

    Raises:
        ValueError: cameras whose keypoints the people miss, or bodies of impossible size.
    """
    mend = "`mvpose doctor` tells what is wrong; --trust writes these people nevertheless"
    if np.isfinite(agreed.body) and not _BODIES[0] < agreed.body < _BODIES[1]:
        raise ValueError(
            f"the people measure {agreed.body:.2g} m from shoulder to ankle, expected {_BODIES[0]} to {_BODIES[1]} m: "
            f"the translations of the calibration are not in metres; {mend}"
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
