"""Errors of a detector by circumstance: shares of people, joints and pairs of them, measured on labelled joints."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats
from simharness.detector.error_classes import MIRROR
from simharness.detector.viewing_conditions import OCCLUDED, SELF_OCCLUDED, VISIBLE
from simharness.reality.detector_fit.detector_sums import Trials
from simharness.reality.detector_fit.joint_labels import LabelledJoints
from simharness.reality.people_tracks import LIMB_JOINTS
from simharness.scenario.sections.detector_section import BEARINGS, KIND_OF_JOINT, KINDS
from simharness.types.truth import MISS_FROM, KeypointError
from tools.network_profile.profiled_scenes import ProfiledScene

_HEIGHTS = (0.0, 60.0, 85.0, 120.0, 170.0, 240.0, 340.0, np.inf)  # pixels
_APART = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.45, np.inf)  # of the height of the box
_SCORES = tuple(np.linspace(0.0, 1.0, 11))
_FAR = (0.0, MISS_FROM, 4.0, 6.0, 9.0, 13.0, 20.0, np.inf)  # units
_UNHIDDEN = 0.1  # share of hidden joints of people in full view
_LAGS = 5


class ErrorCurve(NamedTuple):
    """Share of something by circumstance."""

    title: str
    """What is counted."""
    axis: str
    """What it depends on."""
    labels: tuple[str, ...]
    """Name of each bin, B of them."""
    counts: Trials
    """Trials and events, (B,) each."""

    @property
    def share(self) -> Floats:
        """Events over trials, (B,); NaN without a trial."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.counts.k / self.counts.n)


def error_curves(labels: LabelledJoints) -> dict[str, ErrorCurve]:
    """Return all curves by name. Gross errors are those beyond 2.35 units, inversions and swaps among them."""
    judged = labels.risk["miss"] | labels.taken["inversion"] | labels.taken["swap"]
    gross = judged & ~np.isin(labels.error, (KeypointError.GOOD, KeypointError.JITTER))
    limbs = np.zeros(judged.shape, bool)
    limbs[..., LIMB_JOINTS] = True
    expected, missed = labels.expected, labels.expected & ~labels.association.detected
    hidden = ((labels.occlusion == OCCLUDED) | ~labels.inside).mean(axis=-1)
    height = labels.boxes[..., 3]
    apart, near = _apart(labels, labels.target[..., MIRROR, :]), neighbour_distance(labels)
    kinds = np.broadcast_to(np.array(KIND_OF_JOINT), judged.shape)
    bearing = np.broadcast_to(labels.bearing[..., None], judged.shape)
    distance = np.linalg.norm(labels.residual, axis=-1)
    in_view = expected & (hidden < _UNHIDDEN)
    behind = judged & (labels.occlusion == OCCLUDED) & limbs
    inverted = labels.risk["inversion"] & limbs
    curves = {
        "missed by size": _binned("people missed", "height, px", height, _HEIGHTS, in_view, missed),
        "missed by hidden": _binned(
            "people missed", "hidden joints, %", 100 * hidden, (0, 10, 25, 40, 55, 70, 85, 101), expected, missed
        ),
        "inversion by separation": _binned(
            "inversions", "left and right apart, heights", apart, _APART, inverted, labels.taken["inversion"]
        ),
        "inversion by bearing": _named(
            "inversions",
            "bearing of the camera, degrees",
            bearing,
            list(map(str, BEARINGS)),
            inverted,
            labels.taken["inversion"],
        ),
        "swap by distance": _binned(
            "swaps", "neighbour's joint away, heights", near, _APART, labels.risk["swap"], labels.taken["swap"]
        ),
        **{
            f"gross, {name}": _named(
                f"gross errors, {name}", "", kinds, KINDS, judged & (labels.occlusion == state), gross
            )
            for state, name in ((VISIBLE, "visible"), (SELF_OCCLUDED, "self-occluded"), (OCCLUDED, "hidden"))
        },
        "jitter": _named(
            "jitters, visible",
            "",
            kinds,
            KINDS,
            labels.risk["jitter"] & (labels.occlusion == VISIBLE),
            labels.taken["jitter"],
        ),
        "hidden by distance": _shares("hidden joints that are this far off", "units", distance, _FAR, behind),
        "scores": _binned(
            "right (within 2.35 units)",
            "score of the keypoint",
            labels.association.scores,
            _SCORES,
            judged & limbs,
            ~gross,
        ),
        "views": _pairs("wrong in another view too", KINDS, judged, gross),
        "memory": _later("wrong again later", labels, judged & limbs, gross),
    }
    return curves


def condition_curves(scenes: Sequence[ProfiledScene], labels: LabelledJoints) -> dict[str, ErrorCurve]:
    """Return people missed, false detections a picture and gross errors of limbs by the condition of the scenes."""
    cases = list(dict.fromkeys(scene.case for scene in scenes))
    case = np.repeat([cases.index(scene.case) for scene in scenes], [len(scene.sequence) for scene in scenes])
    judged = (labels.risk["miss"] | labels.taken["inversion"] | labels.taken["swap"])[..., LIMB_JOINTS]
    wrong = ~np.isin(labels.error[..., LIMB_JOINTS], (KeypointError.GOOD, KeypointError.JITTER))
    missed = labels.expected & ~labels.association.detected

    def by_case(n: NDArray, k: NDArray) -> Trials:
        return Trials(
            *(
                np.bincount(case, each.reshape(len(case), -1).sum(axis=1), len(cases)).astype(np.float64)
                for each in (n, k)
            )
        )

    false = labels.association.false
    return {
        "missed": ErrorCurve("people missed", "", tuple(cases), by_case(labels.expected, missed)),
        "false": ErrorCurve(
            "false detections per 100 pictures", "", tuple(cases), by_case(np.ones(false.shape), false)
        ),
        "gross": ErrorCurve("gross errors of limbs", "", tuple(cases), by_case(judged, judged & wrong)),
    }


def part_counts(labels: LabelledJoints) -> Mapping[str, Trials]:
    """Return joints and errors by kind of joint, (9,) each: inversions, misses, and all gross errors."""
    of_kind = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
    judged = labels.risk["miss"] | labels.taken["inversion"] | labels.taken["swap"]
    gross = judged & ~np.isin(labels.error, (KeypointError.GOOD, KeypointError.JITTER))

    def by_kind(n: Bools, k: Bools) -> Trials:
        return Trials(*(each.sum(axis=(0, 1, 2)) @ of_kind for each in (n, n & k)))

    return {
        "inversion": by_kind(labels.risk["inversion"], labels.taken["inversion"]),
        "miss": by_kind(labels.risk["miss"], labels.taken["miss"]),
        "gross": by_kind(judged, gross),
    }


def neighbour_distance(labels: LabelledJoints) -> Floats:
    """Return the distance of each joint from that of the nearest other person, heights of the box, (T, V, P, 17)."""
    return _apart(labels, _neighbours(labels))


def _apart(labels: LabelledJoints, other: Floats) -> Floats:
    """Return the distance of joints from other places, heights of the box, (T, V, P, 17); NaN where unknown."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.linalg.norm(labels.target - other, axis=-1) / labels.boxes[..., 3:])


def _neighbours(labels: LabelledJoints) -> Floats:
    """Return the same joint of the nearest other person, (T, V, P, 17, 2); NaN where there is none."""
    target = np.where(labels.known[:, None, :, None, None], labels.target, np.nan)
    people = target.shape[2]
    best, result = np.full(target.shape[:-1], np.inf), np.full(target.shape, np.nan)
    for shift in range(1, people):
        other = np.roll(target, shift, axis=2)
        far = np.nan_to_num(np.linalg.norm(labels.target - other, axis=-1), nan=np.inf)
        nearer = far < best
        best[nearer], result[nearer] = far[nearer], other[nearer]
    return result


def _named(title: str, axis: str, index: NDArray, names: Sequence[str], trials: Bools, events: Bools) -> ErrorCurve:
    counts = Trials(
        *(np.bincount(index[each], minlength=len(names)).astype(float) for each in (trials, trials & events))
    )
    return ErrorCurve(title, axis, tuple(names), counts)


def _binned(title: str, axis: str, values: Floats, edges: Sequence[float], trials: Bools, events: Bools) -> ErrorCurve:
    known = trials & np.isfinite(values)
    index = np.clip(np.digitize(np.nan_to_num(values), edges) - 1, 0, len(edges) - 2)
    return _named(title, axis, index, _bins(edges), known, events)


def _shares(title: str, axis: str, values: Floats, edges: Sequence[float], trials: Bools) -> ErrorCurve:
    """Return how the values are distributed over the bins."""
    counts = _binned(title, axis, values, edges, trials, trials).counts.k
    return ErrorCurve(title, axis, _bins(edges), Trials(np.full(len(counts), counts.sum()), counts))


def _bins(edges: Sequence[float]) -> tuple[str, ...]:
    return tuple(f"{low:.3g}" + ("–" + f"{high:.3g}" if np.isfinite(high) else "+") for low, high in pairwise(edges))


def _pairs(title: str, names: Sequence[str], trials: Bools, events: Bools) -> ErrorCurve:
    """Return how often a joint that is wrong in one view is wrong in another, by kind of joint."""
    of_kind = np.eye(len(KINDS))[list(KIND_OF_JOINT)]
    n = k = np.zeros(len(KINDS))
    for one in range(trials.shape[1]):
        for other in range(trials.shape[1]):
            if one != other:
                first = trials[:, one] & events[:, one] & trials[:, other]
                n = n + first.sum(axis=(0, 1)) @ of_kind
                k = k + (first & events[:, other]).sum(axis=(0, 1)) @ of_kind
    return ErrorCurve(title, "", tuple(names), Trials(n, k))


def _later(title: str, labels: LabelledJoints, trials: Bools, events: Bools) -> ErrorCurve:
    """Return how often a joint that is wrong in one frame is wrong in the same view some frames later."""
    n, k = np.zeros(_LAGS), np.zeros(_LAGS)
    for lag in range(1, min(_LAGS + 1, len(trials))):
        near = labels.time[lag:] - labels.time[:-lag] < (lag + 0.5) * labels.step
        first = (trials & events)[:-lag] & trials[lag:] & near[:, None, None, None]
        n[lag - 1], k[lag - 1] = first.sum(), (first & events[lag:]).sum()
    return ErrorCurve(title, "seconds", tuple(f"{lag * labels.step:.2g}" for lag in range(1, _LAGS + 1)), Trials(n, k))
