"""Response to treatments: what the same added errors cost in reality and in twins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats
from simharness.reality.validation.evidence import Compared, Evidence, Figure, rank_correlation
from simharness.reality.validation.passes import Unchanged
from simharness.reality.validation.score_sums import DEFAULT_RULE, ScoreSums
from simharness.reality.validation.treatments import KINDS, Treatment
from simharness.scoring.frame_scores import RULES, HeadRule
from simharness.statistics.intervals import Interval

_FILLED = RULES[2]
_UNCHANGED = Unchanged()


@dataclass(frozen=True)
class DoseResponse:
    """What one treatment costs one variant; means over draws.

    Attributes:
        kind: key of the treatment.
        level: its level.
        variant: the variant.
        loss: PCP without the treatment minus PCP with it, points.
        loss_filled: the same with missing joints of the face filled from the others.
        ghosts: ghosts per frame with the treatment minus without.
        recall: recall without the treatment minus with it, 0 to 1.
        mpjpe: MPJPE with the treatment minus without, mm.
        draws: loss of each of n draws, in reality and, mean over twins, in simulation, (2, n), points.
        resamples: loss of each draw in R bootstrap resamples of reality, (R, n), points.
    """

    kind: str
    level: float
    variant: str
    loss: Compared
    loss_filled: Compared
    ghosts: Compared
    recall: Compared
    mpjpe: Compared
    draws: Floats
    resamples: Floats

    @property
    def rank(self) -> Interval:
        """Spearman's correlation of the losses of reality and of twins over the draws; NaN for fewer than three."""
        return rank_correlation(*self.draws, resamples=self.resamples)


def compare_responses(evidence: Evidence, variants: Sequence[str]) -> list[DoseResponse]:
    """Compare reality and twins on all treatments of which the evidence has passes, and on no treatment."""
    given: dict[tuple[str, float], list[Treatment]] = {}
    for change in evidence.real:
        if isinstance(change, Treatment):
            given.setdefault((change.kind, change.level), []).append(change)
    order = list(KINDS)
    return [
        _response(evidence, treatments, variant)
        for _, treatments in sorted(given.items(), key=lambda item: (order.index(item[0][0]), item[0][1]))
        for variant in variants
    ]


def _response(evidence: Evidence, treatments: Sequence[Treatment], variant: str) -> DoseResponse:
    first = treatments[0]

    def change(score: Callable[[ScoreSums, HeadRule], Floats], sign: float, rule: HeadRule = DEFAULT_RULE) -> Compared:
        return evidence.compare(_mean([_change(each, variant, score, sign, rule) for each in treatments]))

    losses = [_change(each, variant, ScoreSums.pcp, -1.0, DEFAULT_RULE) for each in treatments]
    twins = [[float(loss(twin)) for twin in evidence.twins] for loss in losses]
    return DoseResponse(
        kind=first.kind,
        level=first.level,
        variant=variant,
        loss=change(ScoreSums.pcp, -1.0),
        loss_filled=change(ScoreSums.pcp, -1.0, _FILLED),
        ghosts=change(ScoreSums.ghosts, 1.0),
        recall=change(ScoreSums.recall, -1.0),
        mpjpe=change(ScoreSums.mpjpe, 1.0),
        draws=np.array([[float(loss(evidence.real)) for loss in losses], np.mean(twins, axis=1)]),
        resamples=np.stack([np.asarray(loss(evidence.resamples)) for loss in losses], axis=-1),
    )


def _change(
    treatment: Treatment,
    variant: str,
    score: Callable[[ScoreSums, HeadRule], Floats],
    sign: float,
    rule: HeadRule,
) -> Figure:
    """Return the figure of a score with the treatment minus without, times a sign."""
    return lambda sums: sign * (score(sums[treatment][variant], rule) - score(sums[_UNCHANGED][variant], rule))


def _mean(figures: Sequence[Figure]) -> Figure:
    return lambda sums: np.mean(np.stack([np.asarray(figure(sums), float) for figure in figures]), axis=0)
