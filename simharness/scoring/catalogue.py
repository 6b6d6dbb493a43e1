"""Catalogue of all scores of a trial: key, meaning, unit and direction.

A score is None (null in tables) where it does not apply: the error of pairs without any pair, a share of zero.
"""

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from mvpose import COCO17
from simharness.scoring.feet_and_hands import WHOLE_BODY_MM
from simharness.scoring.pcp import GROUPS
from simharness.scoring.score_registry import ScoreInfo, registered_scores

__all__ = ["AP_MM", "HEADLINE", "PCK_MM", "SCORES", "TOLERANCES", "ScoreInfo"]

AP_MM = (25, 50, 75, 100, 125, 150)
"""Thresholds of average precision, mm."""

PCK_MM = (50, 100, 150)
"""Thresholds of PCK, mm."""

_FAILURES = {
    "missed": "true people without an estimate who are neither merged nor split",
    "ghost": "estimates that match no person and are not the second estimate of a split",
    "merged": "wrong people in an estimate that mixes detections of several people",
    "split": "people whose detections are divided among several estimates",
    "swapped_limb": "people with a joint at the place of its left-right counterpart or of another person's joint",
    "displaced_joint": "people with a displaced joint and none of the other failures",
}


def _higher(key: str, title: str, about: str, *, digits: int = 1, tolerance: float | None = None) -> ScoreInfo:
    """Describe a percentage for which higher is better."""
    return ScoreInfo(key, title, "%", about, "higher", digits, tolerance=tolerance)


def _lower(
    key: str, title: str, unit: str, about: str, *, digits: int = 1, tolerance: float | None = None
) -> ScoreInfo:
    """Describe a score for which lower is better."""
    return ScoreInfo(key, title, unit, about, "lower", digits, tolerance=tolerance)


def _pose() -> Iterator[ScoreInfo]:
    part = "their ends are off by at most half their length on average"
    yield _higher("pcp", "PCP", f"correct body parts: {part}; ignores ghosts", tolerance=0.5)
    for group in GROUPS:
        name = group.replace("_", " ")
        yield _higher(f"pcp_{group}", f"PCP {name}", f"correct body parts, {name} only")
    yield _higher("recall", "Recall", "true people paired with an estimate within 500 mm", tolerance=0.5)
    yield _higher("precision", "Precision", "estimates paired with a true person within 500 mm", tolerance=0.5)
    yield _lower("ghosts", "Ghosts", "per frame", "estimates that match no person", digits=2, tolerance=0.02)
    yield _lower("missed", "Missed", "per frame", "true people without an estimate", digits=2, tolerance=0.01)
    yield _lower(
        "mpjpe_mm", "MPJPE", "mm", "mean joint error of the people found; ignores missed people", tolerance=0.5
    )
    yield _lower("mpjpe_median_mm", "Median error", "mm", "median over the people found of their mean joint error")
    for joint in COCO17.joints:
        name = joint.replace("_", " ")
        yield _lower(f"mpjpe_{joint}_mm", f"Error {name}", "mm", f"mean error of the {name} of the people found")
    for limit in AP_MM:
        about = f"average precision of people within {limit} mm, estimates sorted by score"
        yield _higher(f"ap{limit}", f"AP {limit}", about)
    about = f"mean of AP at {AP_MM[0]} to {AP_MM[-1]} mm"
    yield _higher("map", "mAP", about, tolerance=0.5)  # sees the order of the scores of people
    for limit in PCK_MM:
        yield _higher(f"pck{limit}", f"PCK {limit}", f"true joints of all people estimated within {limit} mm")
    yield _higher("pck_auc", "PCK area", f"mean of PCK over all limits from 0 to {PCK_MM[-1]} mm")
    yield from (info for group in registered_scores() for info in group.infos)
    for limb in ("feet", "hands"):
        about = f"mean error of the joints of the {limb} of the people found; where the detector reports them"
        yield _lower(f"{limb}_mm", f"Error {limb}", "mm", about)
        about = f"joints of the {limb} of all people estimated within {WHOLE_BODY_MM} mm"
        yield _higher(f"{limb}_pck", f"PCK {limb}", about)
    about = "median error of the reprojected estimates at visible, detected joints"
    yield _lower("reprojection_px", "Reprojection", "px", about, digits=2)
    about = "median error of the detections at the joints of Reprojection; should be the larger one"
    yield _lower("detection_px", "Detection", "px", about, digits=2)


def _matching() -> Iterator[ScoreInfo]:
    yield _higher("match_precision", "Match precision", "matched pairs of detections that show the same person")
    yield _higher("match_recall", "Match recall", "pairs of detections of the same person that are matched")
    yield _higher("match_f1", "Match F1", "harmonic mean of match precision and match recall", tolerance=0.5)
    about = "detections that share an estimate with another detection of their view; always 0 for a valid matching"
    yield _lower("violations", "Violations", "per frame", about, digits=2)
    about = "estimates from detections of two or more true people"
    yield _lower("merged", "Merged estimates", "per frame", about, digits=2)
    about = "true people whose detections are divided among several estimates"
    yield _lower("split", "Split people", "per frame", about, digits=2)
    yield _lower("phantoms_admitted", "Phantoms admitted", "%", "phantoms that are part of an estimate")
    yield _higher("phantoms_pruned", "Phantoms pruned", "phantoms that are part of no estimate")


def _times() -> Iterator[ScoreInfo]:
    for stage in ("affinity", "matching", "reconstruction"):
        yield _lower(f"time_{stage}_ms", f"Time {stage}", "ms", f"median time per frame of {stage}", digits=2)
    yield _lower("time_ms", "Time", "ms", "median time per frame of all stages", digits=2)
    yield _lower("time_p99_ms", "Time, 99 %", "ms", "99th percentile of the time per frame", digits=2)


def _failures() -> Iterator[ScoreInfo]:
    for kind, about in _FAILURES.items():
        yield _lower(f"failures_{kind}", f"Failures, {kind.replace('_', ' ')}", "per frame", about, digits=2)
    for stage in ("detection", "matching", "reconstruction"):
        about = f"failures removed by the truth in place of {stage}, and not in place of an earlier stage"
        yield _lower(f"blame_{stage}", f"Blame {stage}", "%", about)
    about = "failures that perfect detections do not remove, for a method that takes and returns no labels"
    yield _lower("blame_method", "Blame method", "%", about)


SCORES: Mapping[str, ScoreInfo] = MappingProxyType(
    {info.key: info for part in (_pose, _matching, _times, _failures) for info in part()}
)
"""Descriptions of all scores by key, in the order of the columns of a study's table of trials."""

HEADLINE = ("pcp", "recall", "precision", "mpjpe_mm", "match_f1", "ghosts")
"""Keys of the headline scores of tables; a gate checks those of :data:`TOLERANCES`."""

TOLERANCES: Mapping[str, float] = MappingProxyType(
    {info.key: info.tolerance for info in SCORES.values() if info.tolerance is not None}
)
"""Scores that a gate compares, in the order of the columns of its baseline, each with its tolerance.

Between processors, means over the shipped suite differ by less than a hundredth of these values, and means over one of
its conditions by less than a third. Scores of people over time (HOTA, IDF1) apply to variants that give identities."""
