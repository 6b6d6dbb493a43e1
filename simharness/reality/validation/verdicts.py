"""Verdicts of a validation: tests of equivalence, each of the interval of a difference against a bound.

Two one-sided tests at 5 % (Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15, 1987): a figure *holds*
where the whole 90 % interval of the difference between twins and recording is inside the bound, and *fails* where it is
outside. Else nobody can tell: a noisy figure is never a good one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from simharness.reality.annotated_recording import DetectorKind
from simharness.reality.validation.detection_figures import BONES
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.skill import Forecasts
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.variant_comparison import DoseResponse, SubsetComparison
from simharness.scoring.frame_scores import HeadRule
from simharness.statistics.intervals import Interval

_ROUNDING = 1e-9  # correlations of few ranks are round numbers, such as 0.8
_CURVES = ("full", "fast", "no-matching")  # variants whose subsets have bounds
_LEAST_DRAWS = 8  # fewer, as in a quick validation, give a rank correlation that says nothing

GROUPS: Mapping[str, str] = {
    "pcp": "PCP of every variant, both head rules",
    "parts": "PCP of parts of the body",
    "contrasts": "differences between variants",
    "order": "order of variants where reality is clear",
    "mpjpe": "MPJPE of every variant",
    "recall": "recall of every variant",
    "ghosts": "ghosts per frame of every variant",
    "subsets": "PCP with each subset of the cameras",
    "subset_mean": "mean error over the subsets",
    "gains": "full minus fast with fewer cameras",
    "subset_rank": "rank of the pairs of cameras",
    "dose": "loss of PCP by treatment",
    "draw_rank": "rank of the draws of calibration errors",
    "bones": "variation of triangulated bones",
    "detected": "people with a usable detection, by view",
    "residual": "distance from the other views, by view",
    "memory": "memory of that distance, by view",
    "gross": "gross errors",
    "epipolar": "distance of viewing rays by pair of views",
    "offset": "the same with its sign",
    "annotation": "truth from the consensus of the views",
    "missing": "joints that are not reported",
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
    parts: float = 3.0
    """PCP of a group of parts of the body, points."""
    contrasts: float = 1.0
    """PCP of one variant minus that of another, points."""
    mpjpe: float = 0.15
    """MPJPE of a variant, as a share of reality's."""
    recall: float = 0.02
    """Recall of a variant, 0 to 1."""
    ghosts: float = 0.1
    """Ghosts per frame of a variant."""
    subset: float = 4.0
    """PCP of a variant with one subset of the cameras, points."""
    subset_mean: float = 2.0
    """Mean over the subsets of the absolute difference, points."""
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
    spread: tuple[float, float] = (0.8, 1.25)
    """The same of distances of keypoints, rays and truth from the other views."""
    offset: float = 10.0
    """Mean distance of the viewing rays of two views with its sign, mm."""
    gross: float = 0.02
    """Share of gross errors of a kind of joint."""
    memory: float = 0.15
    """Correlation of these distances from one frame to the next."""
    detected: float = 0.03
    """Share of people with a usable detection in a view."""
    missing: float = 0.03
    """Share of joints of a kind that are not reported."""
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
    CANNOT_TELL = "cannot tell"
    FAILS = "fails"


def equivalence(low: float, high: float, least: float, greatest: float) -> VerdictState:
    """Return the verdict on a difference, from its interval and the least and greatest that is accepted."""
    if least <= low and high <= greatest:
        return VerdictState.HOLDS
    return VerdictState.FAILS if low > greatest or high < least else VerdictState.CANNOT_TELL


@dataclass(frozen=True)
class BoundVerdict:
    """Verdict on one figure."""

    group: str
    """Key of the group of figures that share a bound: ``pcp``, ``dose`` and so on."""
    name: str
    """Dotted name of the figure, unique in a validation."""
    real: float
    """Figure of the recording; NaN where the figure is a correlation or an error of both."""
    twin: float
    """Figure of the twins."""
    low: float
    """Lower end of the interval that is judged: of the difference, or of the correlation or error."""
    high: float
    """Upper end."""
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
    parts: Mapping[str, Mapping[str, Compared]],
    contrasts: Mapping[tuple[str, str], Mapping[HeadRule, Compared]],
    bounds: Bounds,
) -> Iterator[BoundVerdict]:
    """Yield the verdicts on the variants with all cameras; PCP and MPJPE by both head rules as published."""
    for name, scores in variants.items():
        for rule, figure in _published(scores["pcp"]):
            yield near("pcp", f"pcp.{name}.{rule}", figure, bounds.pcp)
        for rule, figure in _published(scores["mpjpe_mm"]):
            limit = bounds.mpjpe * figure.real.mean
            yield near("mpjpe", f"mpjpe.{name}.{rule}", figure, limit, text=f"± {100 * bounds.mpjpe:g} %")
        (_, recall), (_, ghosts) = (next(_published(scores[key])) for key in ("recall", "ghosts_per_frame"))
        yield near("recall", f"recall.{name}", recall, bounds.recall)
        yield near("ghosts", f"ghosts.{name}", ghosts, bounds.ghosts)
    for name, groups in parts.items():
        for group, figure in groups.items():
            if np.isfinite(figure.real.mean):
                yield near("parts", f"parts.{name}.{group}", figure, bounds.parts)
    for (one, other), figures in contrasts.items():
        for rule, figure in _published(figures):
            yield near("contrasts", f"contrasts.{one}.{other}.{rule}", figure, bounds.contrasts)
            order = same_sign(f"order.{one}.{other}.{rule}", figure)
            if order is not None:
                yield order


def judge_subsets(subsets: SubsetComparison, bounds: Bounds) -> Iterator[BoundVerdict]:
    """Yield the verdicts on subsets of the cameras, numbered from 1 in names."""
    names = [name for name in _CURVES if name in subsets.single]
    for name in names:
        single = subsets.single[name]
        fewer = {views: each for views, each in single.items() if len(views) < max(map(len, single))}
        for views, figure in fewer.items():
            cameras = " ".join(str(view + 1) for view in views)
            yield near("subsets", f"subsets.{name}.{cameras}", figure, bounds.subset)
        if fewer:
            error = Forecasts(tuple(fewer.values())).error
            yield at_most("subset_mean", f"subset_mean.{name}", error, bounds.subset_mean)
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
    limits = {
        **dict.fromkeys(("detected", "detected_views"), bounds.detected),
        "missing": bounds.missing,
        **dict.fromkeys(("gross", "gross_joints"), bounds.gross),
        "offset": bounds.offset,
        "memory": bounds.memory,
        "tree": bounds.tree if kind == "bottom-up" else np.nan,
        "ears": bounds.ears,
        "behind": bounds.behind,
    }
    shares = {f"bones.{bone}": bounds.bones for bone in BONES}
    for key, figure in measured.items():
        group = key.partition(".")[0]
        if not np.isfinite(figure.real.mean):
            continue
        if key in shares or group in ("residual", "epipolar", "annotation"):
            yield ratio(group, key, figure, *shares.get(key, bounds.spread))
        elif np.isfinite(limits.get(group, np.nan)):
            yield near(group.partition("_")[0], key, figure, limits[group])
        elif key == "affinity.different":
            yield near("ambiguous", "ambiguous", figure, bounds.ambiguous * figure.real.mean, text="± a third")


def within(group: str, name: str, figure: Compared, low: float, high: float, *, bound: str = "") -> BoundVerdict:
    """Return the verdict on a difference that must lie between ``low`` and ``high``.

    Args:
        group: group of the figure.
        name: name of the figure.
        figure: the figure. Where the recording has it and twins do not, it fails.
        low: least accepted difference between twins and recording, 0 or less.
        high: greatest accepted difference, 0 or more.
        bound: text of the bound; by default the greatest accepted difference.
    """
    real, twin, ends = figure.real.mean, figure.twin.mean, figure.tested
    state = VerdictState.FAILS if np.isfinite(real) and not np.isfinite(twin) else equivalence(*ends, low, high)
    return BoundVerdict(group, name, real, twin, *ends, bound or f"± {high:.3g}", state)


def near(group: str, name: str, figure: Compared, bound: float, *, text: str = "") -> BoundVerdict:
    """Return the verdict on a difference of at most ``bound`` in either direction."""
    return within(group, name, figure, -bound, bound, bound=text)


def ratio(group: str, name: str, figure: Compared, low: float, high: float) -> BoundVerdict:
    """Return the verdict on the ratio of twins to recording, which must lie between ``low`` and ``high``."""
    real = figure.real.mean
    return within(group, name, figure, (low - 1) * real, (high - 1) * real, bound=f"{low:g}–{high:g} ×")


def at_most(group: str, name: str, error: Interval, bound: float) -> BoundVerdict:
    """Return the verdict on an error, which must be at most ``bound``."""
    state = equivalence(error.low, error.high, -np.inf, bound)
    return BoundVerdict(group, name, float("nan"), error.mean, error.low, error.high, f"≤ {bound:g}", state)


def at_least(group: str, name: str, rank: Interval, bound: float) -> BoundVerdict:
    """Return the verdict on a correlation, which must be at least ``bound``."""
    state = equivalence(rank.low, rank.high, bound - _ROUNDING, np.inf)
    return BoundVerdict(group, name, float("nan"), rank.mean, rank.low, rank.high, f"≥ {bound:g}", state)


def same_sign(name: str, contrast: Compared) -> BoundVerdict | None:
    """Return the verdict on the order of two variants, None where reality is not clear about it.

    An order is clear where the interval of the contrast excludes 0.
    """
    real, twin = contrast.real, contrast.twin
    if not (real.low > 0 or real.high < 0):
        return None
    sides = (0.0, np.inf) if real.low > 0 else (-np.inf, 0.0)
    state = equivalence(twin.low, twin.high, *sides)
    return BoundVerdict("order", name, real.mean, twin.mean, twin.low, twin.high, "same sign", state)


def _published(figures: Mapping[HeadRule, Compared]) -> Iterator[tuple[HeadRule, Compared]]:
    return ((rule, figure) for rule, figure in figures.items() if not rule.filled)
