"""Views that contribute nothing: without detections, or with detections of other people than the other views have.

Pictures that are mirrored and exchanged names of left and right are among the conventions (:mod:`.conventions`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.findings import Finding

_SILENT = 0.02  # share of the median number of detections of a view below which it contributes nothing
_FEW = 0.20  # share of the median number of detections below which all of them may be false
_STRANGER = 0.68
"""Mean agreement with the other views, over theirs, below which a view sees other people: 0.4 to 0.62 for the same room
at another time, 0.85 and more for cameras that see the same people (simulated rigs, seeds 9100 to 9106)."""

_MAJORITY = 0.60  # mean agreement of the other views, below which they see different people themselves
_SHARED = 0.40  # agreement from which two views see the same people


@dataclass(frozen=True)
class PairAgreement:
    """How well pairs of views agree.

    Attributes:
        pairs: evidence of each pair as a share of what it would be without errors, (V, V), 0 to 1; NaN where the two
            views have no detections at the same time.
    """

    pairs: Floats

    @classmethod
    def measured(cls, consistency: Consistency, *readings: Reading) -> PairAgreement:
        """Return the agreement of all pairs of views, at each time under the best of some readings."""
        evidence = np.max([consistency(each) for each in readings], axis=0).sum(axis=2)
        ideal = consistency.ideal(readings[0]).sum(axis=2)
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
        findings.append(
            Finding(
                "silent-view",
                f"{names[view]} has {count or 'no'} detections, a view of this rig has usually {usual:.0f}",
                camera=names[view],
                view=view,
                size={"detections": float(count)},
                cost=0.05,
                mend="check the pictures and the detector of this camera, or leave it out of the rig",
            )
        )
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
        if detections[view] < many:
            findings.append(
                Finding(
                    "silent-view",
                    f"{names[view]} has {detections[view]} detections, and they fit none of the other cameras",
                    severity="note",
                    camera=names[view],
                    view=view,
                    size={"detections": float(detections[view])},
                    cost=0.05,
                    mend="a detector finds few people from steeply above or far away: move the camera or leave it out",
                )
            )
            continue
        findings.append(
            Finding(
                "other-people",
                f"the people in the pictures of {names[view]} are not those of the other cameras: other people are in "
                "them, they are of another time or place, or the calibration of this camera is entirely wrong",
                probability=0.95,
                camera=names[view],
                view=view,
                size={"agreement": float(agreement.mean[view])},
                cost=1.0 / views,
                mend="compare the pictures of this camera with those of the others at one time; calibrate it again, or "
                "leave it out of the rig",
            )
        )
    return findings
