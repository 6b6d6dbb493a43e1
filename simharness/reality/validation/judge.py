"""All verdicts of a validation, from its comparisons and the table of bounds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.validation.detection_figures import BONES, TREE
from simharness.reality.validation.dose import Response
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.frame_scores import HeadRule
from simharness.reality.validation.subsets import SubsetComparison
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.verdicts import Bounds, Verdict, at_least, average, near, ratio, same_sign

GROUPS: Mapping[str, str] = {
    "pcp": "PCP of every variant, both head rules",
    "mpjpe": "MPJPE of every variant",
    "no_3dps": "full minus no-3dps",
    "order": "order of variants where reality is clear",
    "subsets": "PCP with fewer cameras",
    "gains": "full minus fast with fewer cameras",
    "subset_rank": "rank of the pairs of cameras",
    "dose": "loss of PCP by treatment",
    "draw_rank": "rank of the draws of calibration errors",
    "bones": "variation of triangulated bones",
    "tree": "children of missing joints are missing",
    "ears": "ears seen by fewer than two views",
    "behind": "joints hidden by others",
    "ambiguous": "ambiguous pairs of detections",
    "split_half": "PCP of one half from a fit to the other",
}
"""Titles of the groups of verdicts, in the order of tables."""

_CURVES = ("full", "fast", "no-matching")  # variants whose subsets have bounds
_LEAST_DRAWS = 8  # fewer, as in a quick validation, give a rank correlation that says nothing


def judge_scores(
    variants: Mapping[str, Mapping[str, Mapping[HeadRule, Compared]]],
    contrasts: Mapping[tuple[str, str], Mapping[HeadRule, Compared]],
    bounds: Bounds,
) -> Iterator[Verdict]:
    """Yield the verdicts on the variants with all cameras, by both head rules as published."""
    for name, scores in variants.items():
        for rule, figure in _published(scores["pcp"]):
            yield near("pcp", f"pcp.{name}.{rule}", figure, bounds.pcp)
        for rule, figure in _published(scores["mpjpe_mm"]):
            limit = bounds.mpjpe * figure.real.mean
            yield near("mpjpe", f"mpjpe.{name}.{rule}", figure, limit, text=f"± {100 * bounds.mpjpe:g} %")
    for (one, other), figures in contrasts.items():
        for rule, figure in _published(figures):
            if {one, other} == {"full", "no-3dps"}:
                yield near("no_3dps", f"no_3dps.{rule}", figure, bounds.no_3dps)
            order = same_sign("order", f"order.{one}.{other}.{rule}", figure)
            if order is not None:
                yield order


def judge_subsets(subsets: SubsetComparison, bounds: Bounds) -> Iterator[Verdict]:
    """Yield the verdicts on subsets of the cameras."""
    names = [name for name in _CURVES if name in subsets.single]
    for name in names:
        curve = {count: each[name] for count, each in subsets.curves.items()}
        yield average("subsets", f"subsets.{name}", curve, bounds.subsets)
    for count, gain in subsets.gains.items():
        yield near("gains", f"gains.{count}", gain, bounds.gain(count))
    for name in names:
        if np.isfinite(subsets.ranks[name].mean):
            yield at_least("subset_rank", f"subset_rank.{name}", subsets.ranks[name], bounds.subset_rank)


def judge_responses(responses: Sequence[Response], bounds: Bounds) -> Iterator[Verdict]:
    """Yield the verdicts on treatments: every loss, and the rank of draws at the highest level of the calibration.

    At lower levels the losses of different draws differ by less than their intervals. Draws of detection errors are
    not ranked: they average over frames, so that none is harder than another.
    """
    for each in responses:
        name = f"{each.kind}.{each.level:g}.{each.variant}"
        yield near("dose", f"dose.{name}", each.loss, bounds.loss_of(each.loss.real.mean))
    for each in responses:
        highest = max(other.level for other in responses if other.kind == each.kind)
        enough = KINDS[each.kind].calibration and each.draws.shape[1] >= _LEAST_DRAWS
        if enough and each.level == highest and np.isfinite(each.rank.mean):
            yield at_least("draw_rank", f"draw_rank.{each.kind}.{each.variant}", each.rank, bounds.draw_rank)


def judge_measurements(measured: Mapping[str, Compared], kind: DetectorKind, bounds: Bounds) -> Iterator[Verdict]:
    """Yield the verdicts on measurements of the detections; what a recording cannot show has none."""
    known = {key: each for key, each in measured.items() if np.isfinite(each.real.mean)}
    for bone in BONES:
        if f"bones.{bone}" in known:
            yield ratio("bones", f"bones.{bone}", known[f"bones.{bone}"], *bounds.bones)
    for name in TREE:
        if kind == "bottom-up" and f"tree.{name}" in known:
            yield near("tree", f"tree.{name}", known[f"tree.{name}"], bounds.tree)
    for key, limit in (("ears", bounds.ears), ("behind", bounds.behind)):
        if key in known:
            yield near(key, key, known[key], limit)
    if "affinity.different" in known:
        figure = known["affinity.different"]
        yield near("ambiguous", "ambiguous", figure, bounds.ambiguous * figure.real.mean, text="± a third")


def _published(figures: Mapping[HeadRule, Compared]) -> Iterator[tuple[HeadRule, Compared]]:
    return ((rule, figure) for rule, figure in figures.items() if not rule.filled)
