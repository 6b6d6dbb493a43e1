"""Verdicts of a validation: each compared figure against a bound.

Three states: a figure within its bound *holds*. One outside *fails*, unless the recording is too short to tell: it is
*unclear* where the interval of the recording is wider than the bound, and the difference lies within the joint interval
of recording and twins.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.validation.detection_figures import BONES, TREE
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.variant_comparison import DoseResponse, SubsetComparison
from simharness.scoring.frame_scores import HeadRule
from simharness.statistics.intervals import Interval

_ROUNDING = 1e-9  # correlations of few ranks are round numbers, such as 0.8
_CURVES = ("full", "fast", "no-matching")  # variants whose subsets have bounds
_LEAST_DRAWS = 8  # fewer, as in a quick validation, give a rank correlation that says nothing

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


@dataclass(frozen=True)
class Bounds:
    """Largest accepted differences between twins and reality."""

    pcp: float = 1.5
    """PCP of a variant, points, with every rule for the head."""
    no_3dps: float = 1.0
    """PCP of ``full`` minus that of ``no-3dps``, points."""
    mpjpe: float = 0.15
    """MPJPE of a variant, as a share of reality's."""
    subsets: float = 2.5
    """PCP of a variant with fewer cameras, points; mean over camera counts of the absolute difference."""
    gains: tuple[tuple[int, float], ...] = ((2, 3.0), (3, 1.5), (4, 1.0))
    """PCP of ``full`` minus that of ``fast``, points, by number of cameras; the last holds for more cameras."""
    subset_rank: float = 0.85
    """Least rank correlation over pairs of cameras."""
    loss: float = 2.0
    """Loss of PCP by a treatment, points."""
    loss_share: float = 0.2
    """The same as a share of reality's loss; the larger of the two counts."""
    draw_rank: float = 0.8
    """Least rank correlation over draws of calibration errors."""
    bones: tuple[float, float] = (0.75, 1.33)
    """Least and greatest ratio of the variation of triangulated bones, twins to reality."""
    tree: float = 0.01
    """Share of missing children of missing parents, for bottom-up detectors."""
    ears: float = 0.014
    """Share of ears that fewer than two views report: 2 % on Shelf, where 0.6 % are measured."""
    behind: float = 0.02
    """Share of joints hidden by other people."""
    ambiguous: float = 1 / 3
    """Share of ambiguous pairs of detections, as a share of reality's."""

    def gain(self, cameras: int) -> float:
        """Return the bound of ``full`` minus ``fast`` with so many cameras."""
        return dict(self.gains).get(cameras, self.gains[-1][1])

    def loss_of(self, real: float) -> float:
        """Return the bound of a loss, given reality's, points."""
        return max(self.loss, self.loss_share * abs(real))


BOUNDS = Bounds()
"""Bounds of ``simharness validate``."""

PREDICTION_BOUNDS = Bounds(pcp=2.5)
"""Bounds where the twins were fitted to other frames than those that they predict."""


class VerdictState(StrEnum):
    """State of a verdict."""

    HOLDS = "holds"
    UNCLEAR = "unclear"
    FAILS = "fails"


@dataclass(frozen=True)
class BoundVerdict:
    """Verdict on one figure."""

    group: str
    """Key of the group of figures that share a bound: ``pcp``, ``dose`` and so on."""
    name: str
    """Dotted name of the figure, unique in a validation."""
    real: float
    """Figure of the recording; NaN where the figure is a correlation of both."""
    twin: float
    """Figure of the twins."""
    bound: str
    """Bound as text."""
    state: VerdictState
    """State."""

    @property
    def difference(self) -> float:
        """The twins' figure minus the recording's."""
        return self.twin - self.real


def judge_scores(
    variants: Mapping[str, Mapping[str, Mapping[HeadRule, Compared]]],
    contrasts: Mapping[tuple[str, str], Mapping[HeadRule, Compared]],
    bounds: Bounds,
) -> Iterator[BoundVerdict]:
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
            order = same_sign(f"order.{one}.{other}.{rule}", figure)
            if order is not None:
                yield order


def judge_subsets(subsets: SubsetComparison, bounds: Bounds) -> Iterator[BoundVerdict]:
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


def judge_responses(responses: Sequence[DoseResponse], bounds: Bounds) -> Iterator[BoundVerdict]:
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


def judge_measurements(measured: Mapping[str, Compared], kind: DetectorKind, bounds: Bounds) -> Iterator[BoundVerdict]:
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


def within(group: str, name: str, figure: Compared, low: float, high: float, *, bound: str = "") -> BoundVerdict:
    """Return the verdict on a difference that must lie between ``low`` and ``high``.

    Args:
        group: group of the figure.
        name: name of the figure.
        figure: the figure.
        low: least accepted difference between twins and recording, 0 or less.
        high: greatest accepted difference, 0 or more.
        bound: text of the bound; by default the greatest accepted difference.
    """
    real, difference = figure.real, figure.difference
    state = VerdictState.HOLDS
    if not low <= difference <= high:  # also where the difference is not a number
        down, up = figure.uncertainty
        allowed, width = (-low, real.mean - real.low) if difference < low else (high, real.high - real.mean)
        chance = difference - down <= 0 <= difference + up
        state = VerdictState.UNCLEAR if chance and width > allowed else VerdictState.FAILS
    return BoundVerdict(group, name, real.mean, figure.twin.mean, bound or f"± {high:.3g}", state)


def near(group: str, name: str, figure: Compared, bound: float, *, text: str = "") -> BoundVerdict:
    """Return the verdict on a difference of at most ``bound`` in either direction."""
    return within(group, name, figure, -bound, bound, bound=text)


def ratio(group: str, name: str, figure: Compared, low: float, high: float) -> BoundVerdict:
    """Return the verdict on the ratio of twins to recording, which must lie between ``low`` and ``high``."""
    real = figure.real.mean
    return within(group, name, figure, (low - 1) * real, (high - 1) * real, bound=f"{low:g}–{high:g} ×")


def average(group: str, name: str, figures: Mapping[int, Compared], bound: float) -> BoundVerdict:
    """Return the verdict on the mean absolute difference of several figures, at most ``bound``.

    It is unclear where it exceeds the bound by no more than the mean distance that the intervals explain, and the
    intervals of the recording are wider than the bound.
    """
    apart = float(np.mean([abs(each.difference) for each in figures.values()]))
    state = VerdictState.HOLDS
    if not apart <= bound:
        chance = np.mean([max(each.uncertainty) for each in figures.values()])
        width = np.mean([(each.real.high - each.real.low) / 2 for each in figures.values()])
        state = VerdictState.UNCLEAR if apart <= chance and width > bound else VerdictState.FAILS
    real, twin = (float(np.mean([getattr(each, side).mean for each in figures.values()])) for side in ("real", "twin"))
    return BoundVerdict(group, name, real, twin, f"mean ± {bound:.3g}", state)


def at_least(group: str, name: str, rank: Interval, bound: float) -> BoundVerdict:
    """Return the verdict on a correlation of at least ``bound``: unclear where its interval reaches the bound."""
    reached = [value >= bound - _ROUNDING for value in (rank.mean, rank.high)]
    state = VerdictState.HOLDS if reached[0] else VerdictState.UNCLEAR if reached[1] else VerdictState.FAILS
    return BoundVerdict(group, name, float("nan"), rank.mean, f"≥ {bound:g}", state)


def same_sign(name: str, contrast: Compared) -> BoundVerdict | None:
    """Return the verdict on the order of two variants, None where reality is not clear about it.

    Reality is clear where the interval of its contrast excludes 0; it is unclear whether twins have the same order
    where they have the other one within their own interval.
    """
    real, twin = contrast.real, contrast.twin
    if not (real.low > 0 or real.high < 0):
        return None
    state = VerdictState.HOLDS
    if np.sign(twin.mean) != np.sign(real.mean):
        state = VerdictState.UNCLEAR if twin.low < 0 < twin.high else VerdictState.FAILS
    return BoundVerdict("order", name, real.mean, twin.mean, "same sign", state)


def _published(figures: Mapping[HeadRule, Compared]) -> Iterator[tuple[HeadRule, Compared]]:
    return ((rule, figure) for rule, figure in figures.items() if not rule.filled)
