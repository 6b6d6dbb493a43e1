"""Whether a recording determines the calibration: how long it is, how much people moved, who saw them.

Views may contribute nothing: those without detections, or with detections of other people than the other views have.
Pictures that are mirrored and exchanged names of left and right are among the conventions (:mod:`.conventions`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.cameras import CameraFit
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.findings import Finding

_SECONDS = 3.0  # of people whom several views see; errors of a detector last for half a second
_TRAVELLED = 1.0  # metres, all people together
_JOINTS = 200  # joints in frames seen by two views or more
_AGREES = 0.7
"""Mean agreement of pairs of views, with all faults corrected, below which no calibration explains the detections: 0.88
to 0.93 in simulated recordings with errors of calibration of up to 2 degrees, at most 0.61 where every view is of
another time (``benchmarks.doctor``)."""
_TURN, _SHIFT = np.radians(0.6), 0.06  # rad, m: largest standard deviations of a pose that is determined

RECORD = (
    "record at least 10 s at 10 pictures a second or more, in which one to four people walk through all of the space "
    "that the cameras share, so that at least three cameras see each of them"
)
"""What to record."""

DIFFERENT = "the cameras do not see the same people at the same time and place"
"""Reason of a finding where no calibration explains the detections."""

SHORT = "people were seen by several cameras for"
"""Reason of a finding where the recording is too short for small errors."""

_SILENT = 0.02  # share of the median number of detections of a view below which it contributes nothing
_FEW = 0.20  # share of the median number of detections below which all of them may be false
_STRANGER = 0.68
"""Mean agreement with the other views, over theirs, below which a view sees other people: 0.4 to 0.62 for the same room
at another time, 0.85 and more for cameras that see the same people (simulated rigs, seeds 9100 to 9106)."""

_MAJORITY = 0.60  # mean agreement of the other views, below which they see different people themselves
_SHARED = 0.40  # agreement from which two views see the same people


@dataclass(frozen=True)
class PairAgreement:
    """How well pairs of views agree."""

    pairs: Floats
    """Evidence of each pair as a share of what it would be without errors, (V, V), 0 to 1; NaN where the two views have
    no detections at the same time."""

    @classmethod
    def measured(cls, consistency: Consistency, *readings: Reading) -> Self:
        """Return the agreement of all pairs of views, at each time under the best of some readings."""
        of_readings = np.stack([consistency(each) for each in readings])
        best = of_readings.argmax(axis=0)[None]
        ideals = np.stack([consistency.ideal(each) for each in readings])
        evidence, ideal = (np.take_along_axis(each, best, axis=0)[0].sum(axis=2) for each in (of_readings, ideals))
        evidence, ideal = evidence + evidence.T, ideal + ideal.T
        with np.errstate(invalid="ignore", divide="ignore"):
            return cls(np.where(ideal > 0, evidence / ideal, np.nan))

    @property
    def best(self) -> Floats:
        """Agreement of each view with the one that it agrees with best, (V,); 0 without any."""
        return np.nan_to_num(self.pairs).max(axis=1)

    @property
    def mean(self) -> Floats:
        """Mean agreement of each view with the others, (V,); 0 without any."""
        known = np.isfinite(self.pairs)
        return np.where(known, self.pairs, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)


def travelled(places: Floats) -> float:
    """Return how far a joint moved, metres: the extent of where it was, without its farthest fifth.

    Args:
        places: places over time, (n, 3), metres; NaN where unknown.
    """
    known = places[np.isfinite(places[:, 0])]
    if len(known) < 8:
        return 0.0
    low, high = np.quantile(known, [0.1, 0.9], axis=0)
    return float(np.linalg.norm(high - low))


def unknowns(
    fit: CameraFit, *, seconds: float, moved: float, agreement: PairAgreement, left_out: set[int], names: Sequence[str]
) -> list[Finding]:
    """Return what the recording does not determine.

    Args:
        fit: what was found about the cameras.
        seconds: time in which people were seen by several views.
        moved: sum of :func:`travelled` over people, of one joint of each.
        agreement: agreement of pairs of views.
        left_out: views that contribute nothing, for which there are findings.
        names: names of the cameras.
    """
    views = len(names)
    used = [view for view in range(views) if view not in left_out]
    joints = int(np.isfinite(fit.equations.joints[:, 0]).sum())
    pairs = [agreement.pairs[i, j] for i in used for j in used if i < j and np.isfinite(agreement.pairs[i, j])]
    if views == 2 or len(used) <= 2:
        which = "the rig has two cameras" if views == 2 else "only two cameras see the same people"
        return [_cannot(f"{which}, and errors of two cameras look like other places of people", "add a third camera")]
    if not pairs or np.mean(pairs) < _AGREES:
        text = f"no calibration explains the detections: {DIFFERENT}, or several cameras are far off"
        return [_cannot(text, f"check that the pictures are of one time, and {RECORD}")]
    if joints < _JOINTS or seconds < _SECONDS:
        return [_cannot(f"{SHORT} {seconds:.1f} s only ({joints} joints)", RECORD)]
    if moved < _TRAVELLED:
        return [_cannot(f"people stood still (they moved by {moved:.1f} m in all)", RECORD)]
    findings = []
    for view in used:
        turn, shift = _uncertainty(fit, view)
        if turn > _TURN or shift > _SHIFT:
            text = f"{names[view]} shares too few people with the other cameras: its pose is determined to "
            text += f"{np.degrees(turn):.1f} degrees and {100 * shift:.0f} cm only"
            findings.append(_cannot(text, RECORD, camera=names[view], view=view))
    if len(findings) > 0.5 * len(used):
        return [_cannot("people were seen in too few places to determine the poses of most cameras", RECORD)]
    return findings


def _uncertainty(fit: CameraFit, view: int) -> tuple[float, float]:
    """Return the standard deviations of turn (rad) and shift (m) of a camera of which nothing is believed."""
    _, pose = fit.freed(view)
    return float(np.sqrt(np.trace(pose[:3, :3]) / 3)), float(np.sqrt(np.trace(pose[3:, 3:]) / 3))


def _cannot(text: str, mend: str, camera: str | None = None, view: int | None = None) -> Finding:
    return Finding("cannot-tell", f"cannot tell: {text}", "unknown", 0.5, camera, view, cost=0.0, mend=mend)


def silent_views(detections: Integers, names: Sequence[str]) -> list[Finding]:
    """Return views with no or nearly no detections.

    Args:
        detections: number of detections of each view in the recording, (V,).
        names: names of the cameras.
    """
    findings = []
    usual = float(np.median(detections[detections > 0])) if (detections > 0).any() else 0.0
    for view, count in enumerate(detections.tolist()):
        if count > _SILENT * usual:
            continue
        text = f"{names[view]} has {count or 'no'} detections, a view of this rig has usually {usual:.0f}"
        mend = "check the pictures and the detector of this camera, or leave it out of the rig"
        size = {"detections": float(count)}
        findings.append(Finding("silent-view", text, camera=names[view], view=view, size=size, cost=0.05, mend=mend))
    return findings


def strangers(agreement: PairAgreement, detections: Integers, names: Sequence[str]) -> list[Finding]:
    """Return findings about views that agree with no other view, where the others agree with each other.

    Args:
        agreement: agreement before or after errors of the cameras were corrected.
        detections: number of detections of each view in the recording, (V,).
        names: names of the cameras.
    """
    findings: list[Finding] = []
    views = len(names)
    if (agreement.best >= _SHARED).sum() < 2:
        return findings
    usual = float(np.median(agreement.best[agreement.best >= _SHARED]))
    alone = (agreement.mean < _STRANGER * usual) & (detections > 0)
    others = agreement.pairs[np.ix_(~alone, ~alone)]
    if not np.isfinite(others).any() or np.nanmean(others) < _MAJORITY:
        return findings  # the other views see different people themselves
    many = _FEW * float(np.median(detections[detections > 0]))
    for view in np.flatnonzero(alone).tolist():
        name = names[view]
        if detections[view] < many:
            text = f"{name} has {detections[view]} detections, and they fit none of the other cameras"
            mend = "a detector finds few people from steeply above or far away: move the camera or leave it out"
            size = {"detections": float(detections[view])}
            findings.append(Finding("silent-view", text, "note", 1.0, name, view, size, cost=0.05, mend=mend))
            continue
        text = f"the people in the pictures of {name} are not those of the other cameras: other people are in them, "
        text += "they are of another time or place, or the calibration of this camera is entirely wrong"
        mend = "compare the pictures of this camera with those of the others at one time; calibrate it again, or "
        mend += "leave it out of the rig"
        size = {"agreement": float(agreement.mean[view])}
        findings.append(Finding("other-people", text, "alarm", 0.95, name, view, size, cost=1.0 / views, mend=mend))
    return findings
