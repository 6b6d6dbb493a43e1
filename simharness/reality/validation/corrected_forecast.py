"""Forecasts corrected by a few labelled frames: what the twins say of all frames, plus what they got wrong in those.

Twins re-enact the recording frame by frame, so that a frame which is hard in reality is often hard in twins. The mean
over all frames of the simulated scores, times a weight, plus the mean over labelled frames of the real scores less the
weighted simulated ones is unbiased whatever the twins are like. It varies less than the labelled frames alone as far as
both go together: a control variate (Sim2Val, arXiv 2506.20553), or prediction-powered inference (Angelopoulos et al.,
Science 382, 2023; for robots SureSim, arXiv 2510.04354). The weight with the least variance is that of a regression; it
is pooled over conditions, because a few frames do not tell it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t

from mvpose.arrays import Floats
from simharness.reality.validation.evidence import number
from simharness.reality.validation.passes import CameraSubset, RecordingChange, ScoreSums, Tallies
from simharness.reality.validation.treatments import Treatment

LABELLED = 20
"""Number of frames whose real scores are known in the evaluation."""

_LEVEL = 0.9


class CorrectedMeans(NamedTuple):
    """Estimates of the mean scores of C conditions over N frames, from few labelled ones."""

    value: Floats
    """Estimates, (C,)."""
    half: Floats
    """Half-widths of their 90 % intervals, (C,)."""
    weight: float
    """Weight of the simulation."""


@dataclass(frozen=True)
class CorrectionStudy:
    """Corrected forecasts of all conditions, evaluated by hiding most of the real frames; means over conditions."""

    conditions: int
    """Number of conditions: subsets of cameras and added errors, of each variant."""
    frames: int
    """Number of frames."""
    labelled: int
    """Number of frames that were not hidden."""
    weight: float
    """Mean weight of the twins."""
    errors: Mapping[str, float]
    """Mean absolute error, points: of the twins, the labelled frames and both (``simulated``, ``labelled``,
    ``corrected``)."""
    coverage: float
    """Share of the 90 % intervals of corrected forecasts that hold the mean over all real frames."""
    width: float
    """Mean width of these intervals over that of the labelled frames alone."""

    def summary(self) -> dict[str, Any]:
        """Return the numbers ready for JSON."""
        return {key: number(each) if isinstance(each, float) else each for key, each in vars(self).items()}


def correct_forecast(
    simulated: Floats, real: Floats, labelled: Sequence[int], *, weight: float | None = None
) -> CorrectedMeans:
    """Return the mean real scores of conditions over all frames, from those of few frames and simulated ones of all.

    Args:
        simulated: simulated scores of C conditions in N frames, (C, N).
        real: real scores in the labelled frames, (C, n).
        labelled: indices of the labelled frames, (n,), spread over the recording: their errors count as independent.
        weight: weight of the simulation; None: that of the least variance, 0 to 1; 0: labelled frames alone.
    """
    of_labelled = simulated[:, list(labelled)]
    if weight is None:
        weight = best_weight(of_labelled, real)
    rest = real - weight * of_labelled
    count, frames = rest.shape[1], simulated.shape[1]
    error = np.sqrt((1 - count / frames) * rest.var(axis=1, ddof=1) / count)
    half = float(t.isf((1 - _LEVEL) / 2, count - 1)) * error
    return CorrectedMeans(weight * simulated.mean(axis=1) + rest.mean(axis=1), half, weight)


def best_weight(simulated: Floats, real: Floats) -> float:
    """Return the weight of simulated scores (C, n) with the least variance, pooled over conditions, 0 to 1."""
    one, other = (each - each.mean(axis=1, keepdims=True) for each in (simulated, real))
    square = float((one**2).sum())
    return float(np.clip((one * other).sum() / square, 0.0, 1.0)) if square else 0.0


def study_corrections(
    real: Mapping[RecordingChange, Tallies], twins: Sequence[Mapping[RecordingChange, Tallies]], rows: Sequence[int]
) -> CorrectionStudy | None:
    """Evaluate corrected forecasts; None with too few frames.

    Args:
        real: tallies of the recording by change.
        twins: the same of its twins, of N frames each.
        rows: rows of these frames in the recording, (N,).
    """
    measured, simulated = _scores(real)[:, list(rows)], np.mean([_scores(each) for each in twins], axis=0)
    known = np.isfinite(measured).all(axis=0) & np.isfinite(simulated).all(axis=0)
    measured, simulated = measured[:, known], simulated[:, known]
    step = measured.shape[1] // LABELLED
    if step < 2:
        return None
    truth, found = measured.mean(axis=1), []
    for first in range(step):
        labelled = range(first, step * LABELLED, step)
        real_scores = measured[:, labelled]
        both, alone = (correct_forecast(simulated, real_scores, labelled, weight=weight) for weight in (None, 0.0))
        errors = [np.abs(each - truth) for each in (simulated.mean(axis=1), alone.value, both.value)]
        inside = errors[-1] <= both.half + 1e-9
        width = both.half.sum() / max(alone.half.sum(), 1e-9)
        found.append([*(each.mean() for each in errors), both.weight, inside.mean(), width])
    simulated_error, alone_error, error, weight, coverage, width = np.mean(found, axis=0).tolist()
    return CorrectionStudy(
        conditions=len(measured),
        frames=measured.shape[1],
        labelled=LABELLED,
        weight=weight,
        errors={"simulated": simulated_error, "labelled": alone_error, "corrected": error},
        coverage=coverage,
        width=width,
    )


def _scores(tallies: Mapping[RecordingChange, Tallies]) -> Floats:
    """Return the share of correct parts of each condition and frame, percent, (C, F); means over draws."""
    groups: dict[tuple[Any, ...], list[Floats]] = {}
    for change, of in tallies.items():
        for name, sums in of.items():
            if isinstance(change, Treatment):
                groups.setdefault((change.kind, change.level, name), []).append(_share(sums, 0))
            elif isinstance(change, CameraSubset):
                groups.setdefault((change, name), []).append(_share(sums, 2))
    return np.array([np.mean(each, axis=0) for each in groups.values()])


def _share(sums: ScoreSums, rule: int) -> Floats:
    """Return the share of correct parts in each frame by one of ``RULES``, percent, (F,); NaN without any."""
    correct, defined = (each[:, rule].sum(axis=-1) for each in (sums.correct, sums.defined))
    return np.where(defined > 0, 100.0 * correct / np.maximum(defined, 1.0), np.nan)
