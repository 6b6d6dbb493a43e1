"""Every score of a trial: its name in tables, what it means, and which way is better.

A score is None (null in tables) where it does not apply: an error of pairs without a pair, a share of nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from mvpose import COCO17
from simharness.scoring.pcp import GROUPS

Better = Literal["higher", "lower"]


@dataclass(frozen=True)
class ScoreInfo:
    """One score.

    Attributes:
        key: its column in tables.
        title: short, for headings.
        unit: of the number; empty where it has none.
        about: one line for whoever sees it for the first time.
        better: which way is better.
        digits: behind the point.
    """

    key: str
    title: str
    unit: str
    about: str
    better: Better
    digits: int


AP_MM = (25, 50, 75, 100, 125, 150)
"""Thresholds of AP, mm."""

PCK_MM = (50, 100, 150)
"""Thresholds of PCK, mm."""

_FAILURES = {
    "missed": "true people without an estimate of their own, for no other reason",
    "ghost": "estimated people who are nobody, not even somebody's second estimate",
    "merged": "wrong people whom an estimate mixes up with somebody else",
    "split": "wrong people whose detections were shared out among estimates",
    "swapped_limb": "people with a joint at the place of the other side's, or of somebody else's",
    "displaced_joint": "people with a joint at a wrong place, for no other reason",
}


def _higher(key: str, title: str, about: str, *, digits: int = 1) -> ScoreInfo:
    """A share of what should be, percent."""
    return ScoreInfo(key, title, "%", about, "higher", digits)


def _lower(key: str, title: str, unit: str, about: str, *, digits: int = 1) -> ScoreInfo:
    return ScoreInfo(key, title, unit, about, "lower", digits)


def _pose() -> Iterator[ScoreInfo]:
    part = "their ends are off by at most half their length on average"
    yield _higher("pcp", "PCP", f"correct body parts: {part}; blind to ghosts")
    for group in GROUPS:
        name = group.replace("_", " ")
        yield _higher(f"pcp_{group}", f"PCP {name}", f"correct body parts of one kind, {name}")
    yield _higher("recall", "Recall", "true people with an estimate of their own within 500 mm")
    yield _higher("precision", "Precision", "estimated people who are someone, within 500 mm")
    yield _lower("ghosts", "Ghosts", "a frame", "estimated people who are nobody", digits=2)
    yield _lower("missed", "Missed", "a frame", "true people without an estimate of their own", digits=2)
    yield _lower("mpjpe_mm", "MPJPE", "mm", "mean error of the joints of the people found; blind to the missed")
    yield _lower("mpjpe_median_mm", "Median error", "mm", "the error of the joints of a typical person found")
    for joint in COCO17.joints:
        name = joint.replace("_", " ")
        yield _lower(f"mpjpe_{joint}_mm", f"Error {name}", "mm", f"mean error of one joint of the people found, {name}")
    for limit in AP_MM:
        about = f"average precision: people within {limit} mm, the surest first, against ghosts and missed"
        yield _higher(f"ap{limit}", f"AP {limit}", about)
    yield _higher("map", "mAP", f"mean of AP at {AP_MM[0]} to {AP_MM[-1]} mm")
    for limit in PCK_MM:
        yield _higher(f"pck{limit}", f"PCK {limit}", f"true joints found within {limit} mm, of all people's")
    yield _higher("pck_auc", "PCK area", f"mean of PCK over all limits from 0 to {PCK_MM[-1]} mm")
    yield _lower("bone_mm", "Bone length", "mm", "by how much the bones of the people found are too long or too short")
    about = "how the error jumps from frame to frame (its second difference); grows with the time between frames"
    yield _lower("jitter_mm", "Jitter", "mm", about)
    about = "median error of the estimates drawn into the pictures, at the visible joints that were detected"
    yield _lower("reprojection_px", "Reprojection", "px", about, digits=2)
    about = "median error of the detections at the joints of Reprojection, which should be smaller"
    yield _lower("detection_px", "Detection", "px", about, digits=2)


def _matching() -> Iterator[ScoreInfo]:
    yield _higher("match_precision", "Match precision", "pairs of detections put together that show one person")
    yield _higher("match_recall", "Match recall", "pairs of detections of one person that were put together")
    yield _higher("match_f1", "Match F1", "harmonic mean of match precision and match recall")
    about = "detections that share an estimate with another of their own view, which must never be"
    yield _lower("violations", "Violations", "a frame", about, digits=2)
    about = "estimates from detections of two true people or more"
    yield _lower("merged", "Merged estimates", "a frame", about, digits=2)
    about = "true people whose detections were shared out among estimates"
    yield _lower("split", "Split people", "a frame", about, digits=2)
    yield _lower("phantoms_admitted", "Phantoms admitted", "%", "detections of nobody that are part of an estimate")
    yield _higher("phantoms_pruned", "Phantoms pruned", "detections of nobody that no estimate was made of")


def _times() -> Iterator[ScoreInfo]:
    for stage in ("affinity", "matching", "reconstruction"):
        yield _lower(f"time_{stage}_ms", f"Time {stage}", "ms", f"median time of a frame, {stage}", digits=2)
    yield _lower("time_ms", "Time", "ms", "median time of a frame, all stages", digits=2)
    yield _lower("time_p99_ms", "Time, 99 %", "ms", "99 of 100 frames take no longer", digits=2)


def _failures() -> Iterator[ScoreInfo]:
    for kind, about in _FAILURES.items():
        yield _lower(f"failures_{kind}", f"Failures, {kind.replace('_', ' ')}", "a frame", about, digits=2)
    for stage in ("detection", "matching", "reconstruction"):
        about = f"failures that the truth in place of {stage} mends, and in place of no stage before"
        yield _lower(f"blame_{stage}", f"Blame {stage}", "%", about)
    about = "failures that perfect detections do not mend, of a method whose other stages cannot be told apart"
    yield _lower("blame_method", "Blame method", "%", about)


SCORES: Mapping[str, ScoreInfo] = MappingProxyType(
    {info.key: info for part in (_pose, _matching, _times, _failures) for info in part()}
)
"""Every column of scores of a study's table of trials, in order."""

HEADLINE = ("pcp", "recall", "precision", "mpjpe_mm", "match_f1", "ghosts")
"""The scores to look at first, and those that a gate guards."""
