"""Whether a recording determines the calibration: how long it is, how much people moved, who saw them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose.arrays import Floats
from mvpose.calibration.camera_models import MODELS, FaultHypothesis
from mvpose.calibration.cameras import CameraFit
from mvpose.calibration.findings import Finding
from mvpose.calibration.views import PairAgreement

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
    fit: CameraFit,
    *,
    seconds: float,
    moved: float,
    agreement: PairAgreement,
    left_out: set[int],
    names: Sequence[str],
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
        return [
            _cannot(
                f"no calibration explains the detections: {DIFFERENT}, or several cameras are far off",
                f"check that the pictures are of one time, and {RECORD}",
            )
        ]
    if joints < _JOINTS or seconds < _SECONDS:
        return [_cannot(f"people were seen by several cameras for {seconds:.1f} s only ({joints} joints)", RECORD)]
    if moved < _TRAVELLED:
        return [_cannot(f"people stood still (they moved by {moved:.1f} m in all)", RECORD)]
    findings = []
    for view in used:
        turn, shift = _uncertainty(fit, view, views)
        if turn > _TURN or shift > _SHIFT:
            findings.append(
                _cannot(
                    f"{names[view]} shares too few people with the other cameras: its pose is determined to "
                    f"{np.degrees(turn):.1f} degrees and {100 * shift:.0f} cm only",
                    RECORD,
                    camera=names[view],
                    view=view,
                )
            )
    if len(findings) > 0.5 * len(used):
        return [_cannot("people were seen in too few places to determine the poses of most cameras", RECORD)]
    return findings


def _uncertainty(fit: CameraFit, view: int, views: int) -> tuple[float, float]:
    """Return the standard deviations of turn (rad) and shift (m) of a camera of which nothing is believed."""
    widest = max((each for each in MODELS if each.kind == "moved-camera"), key=lambda each: each.sigma)
    blocks = len(fit.quadratic.H)
    _, covariance = fit.quadratic.posterior([FaultHypothesis(widest, view, "always", np.ones(blocks))])
    pose = covariance[-6:, -6:]
    return float(np.sqrt(np.trace(pose[:3, :3]) / 3)), float(np.sqrt(np.trace(pose[3:, 3:]) / 3))


def _cannot(text: str, mend: str, camera: str | None = None, view: int | None = None) -> Finding:
    return Finding("cannot-tell", f"cannot tell: {text}", "unknown", 0.5, camera, view, cost=0.0, mend=mend)
