"""Skill of forecasts over many conditions: what the twins add to rivals that need no simulation of the recording.

Skill is 1 minus the mean absolute error of the twins over that of a rival: 1 is a perfect forecast, 0 one that is as
good as the rival, and below 0 the rival is better. Rivals:

- *no loss*: fewer cameras and added errors cost nothing;
- *shipped profile*: a twin of the same people with a detector profile that was not fitted;
- *other recording*: what was measured on another recording.

The mean maximum rank violation is that of Li et al., "Evaluating real-world robot manipulation policies in simulation"
(SIMPLER, CoRL 2024): a forecast may be off by the same amount everywhere and still say which condition is better.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import rankdata

from mvpose.arrays import Floats
from mvpose.files.input_files import read_json_object
from simharness.reality.validation.evidence import Compared, plain, twin_means
from simharness.reality.validation.variant_comparison import DoseResponse, SubsetComparison
from simharness.statistics.intervals import Interval
from simharness.statistics.resampling import interval

NO_LOSS, PROFILE, OTHER = "no loss", "shipped profile", "other recording"
ALL = "all variants"


@dataclass(frozen=True)
class Forecasts:
    """Figures of n conditions, measured and predicted, and the predictions of rivals.

    Arrays begin with the recording or the twins as they are, and continue with R bootstrap resamples of both.
    """

    figures: tuple[Compared, ...]
    """The figures."""
    rivals: Mapping[str, Floats] = field(default_factory=dict)
    """Predictions by rival, (1 + R, n) or (1, n); NaN where it predicts nothing."""

    @property
    def real(self) -> Floats:
        """Figures of the recording, (1 + R, n)."""
        values = [np.append(each.real.mean, each.resamples) for each in self.figures]
        return np.stack(values, axis=-1) if values else np.zeros((1, 0))

    @property
    def twin(self) -> Floats:
        """Means of the twins, (1 + R, n)."""
        twins = np.stack([each.twins for each in self.figures], axis=-1) if self.figures else np.zeros((1, 0))
        return np.concatenate([twins.mean(axis=0, keepdims=True), twin_means(twins, resamples=len(self.real) - 1)])

    @property
    def error(self) -> Interval:
        """Mean absolute difference of the twins."""
        return _resampled(np.abs(self.twin - self.real).mean(axis=1), least=0.0)

    def error_of(self, rival: str) -> Interval:
        """Return the mean absolute difference of a rival where it predicts something."""
        return _resampled(self._errors(rival)[1], least=0.0)

    def skill(self, rival: str) -> Interval:
        """Return the skill of the twins against a rival; NaN where it predicts nothing."""
        own, others = self._errors(rival)
        with np.errstate(invalid="ignore", divide="ignore"):
            return _resampled(1.0 - own / others, greatest=1.0)

    def _errors(self, rival: str) -> tuple[Floats, Floats]:
        """Return the mean absolute differences of the twins and of a rival, (1 + R,) each, where it predicts."""
        known = np.isfinite(self.rivals[rival]).all(axis=0)
        real = self.real[:, known]
        if not known.any():
            return np.full(len(real), np.nan), np.full(len(real), np.nan)
        return (
            np.abs(self.twin[:, known] - real).mean(axis=1),
            np.abs(self.rivals[rival][:, known] - real).mean(axis=1),
        )

    @classmethod
    def joined(cls, parts: Sequence["Forecasts"]) -> "Forecasts":
        """Return the conditions of all parts, with all of their rivals."""
        figures = tuple(figure for part in parts for figure in part.figures)
        size = max((values.shape[0] for part in parts for values in part.rivals.values()), default=1)
        rivals = {}
        for key in dict.fromkeys(key for part in parts for key in part.rivals):
            unknown = [np.full((1, len(part.figures)), np.nan) for part in parts]
            values = [part.rivals.get(key, nothing) for part, nothing in zip(parts, unknown, strict=True)]
            rivals[key] = np.concatenate([np.broadcast_to(each, (size, each.shape[1])) for each in values], axis=1)
        return cls(figures, rivals)


@dataclass(frozen=True)
class Skill:
    """Error of the twins over a group of conditions, and their skill against rivals."""

    what: str
    """Group of conditions: ``losses`` or ``subsets``."""
    variant: str
    """The variant, or :data:`ALL`."""
    conditions: int
    """Number of conditions."""
    error: Interval
    """Mean absolute difference between twins and recording, points of PCP."""
    rivals: Mapping[str, tuple[Interval, Interval]]
    """Mean absolute difference of each rival, and the skill of the twins against it."""

    def summary(self) -> dict[str, Any]:
        """Return the numbers ready for JSON."""
        return {
            "what": self.what,
            "variant": self.variant,
            "conditions": self.conditions,
            "error": plain(self.error),
            "rivals": {
                name: {"error": plain(error), "skill": plain(skill)} for name, (error, skill) in self.rivals.items()
            },
        }


@dataclass(frozen=True)
class RankAgreement:
    """How well twins predict which of the conditions of a variant are better: subsets of cameras and added errors."""

    variant: str
    """The variant."""
    conditions: int
    """Number of conditions, n."""
    pearson: Interval
    """Correlation of PCP."""
    spearman: Interval
    """Correlation of ranks."""
    rank_violation: Interval
    """Mean over conditions of the largest difference of the recording's PCP to a condition that twins rank on the other
    side, points."""

    def summary(self) -> dict[str, Any]:
        """Return the numbers ready for JSON."""
        return {key: plain(each) if isinstance(each, Interval) else each for key, each in vars(self).items()}


def forecast_groups(
    subsets: SubsetComparison,
    responses: Sequence[DoseResponse],
    variants: Sequence[str],
    *,
    other: Mapping[str, float] | None = None,
) -> dict[str, dict[str, Forecasts]]:
    """Return the conditions of ``losses`` by added errors and of ``subsets`` of the cameras, by group and variant.

    Args:
        subsets: comparison of subsets.
        responses: comparison of treatments.
        variants: names of the variants.
        other: figures of another recording, of :func:`read_other_figures`.
    """
    result: dict[str, dict[str, Forecasts]] = {"losses": {}, "subsets": {}}
    for name in variants:
        of = [each for each in responses if each.variant == name]
        keys = [f"{each.kind}.{each.level:g}.{name}" for each in of]
        result["losses"][name] = _with_rivals([each.loss for each in of], np.zeros((1, len(of))), keys, other)
        single = subsets.single[name]
        most = max(len(views) for views in single)
        (whole,) = (figure for views, figure in single.items() if len(views) == most)
        fewer = {views: figure for views, figure in single.items() if len(views) < most}
        nothing = np.append(whole.real.mean, whole.resamples)[:, None].repeat(len(fewer), axis=1)
        keys = [f"{len(views)}.{name}" for views in fewer]
        result["subsets"][name] = _with_rivals(list(fewer.values()), nothing, keys, other)
    return result


def _with_rivals(
    figures: Sequence[Compared], nothing: Floats, keys: Sequence[str], other: Mapping[str, float] | None
) -> Forecasts:
    rivals = {NO_LOSS: nothing, PROFILE: np.array([[each.profile for each in figures]])}
    if other is not None:
        rivals[OTHER] = np.array([[other.get(key, np.nan) for key in keys]])
    return Forecasts(tuple(figures), {key: each for key, each in rivals.items() if np.isfinite(each).any()})


def read_other_figures(path: Path) -> dict[str, float]:
    """Return what was measured on another recording, by condition, from its validation.json.

    Raises:
        ValueError: not the summary of a validation.
    """
    what = "the validation.json of another recording"
    summary = read_json_object(path, what=what)
    try:
        found = {
            f"{kind}.{level}.{name}": figure["real"]
            for kind, levels in summary["dose"].items()
            for level, variants in levels.items()
            for name, figure in variants.items()
        }
        for count, curve in summary["subsets"].items():
            found |= {f"{count}.{name}": figure["real"] for name, figure in curve.items()}
    except (AttributeError, KeyError, TypeError):
        raise ValueError(f"{path}: expected {what}, with the keys dose and subsets") from None
    return {key: float(value) for key, value in found.items() if value is not None}


def skills(groups: Mapping[str, Mapping[str, Forecasts]]) -> list[Skill]:
    """Return the skill over all variants, and of each, for each group of :func:`forecast_groups` with conditions."""
    result = []
    for what, of in groups.items():
        for name, each in {ALL: Forecasts.joined(list(of.values())), **of}.items():
            if each.figures:
                rivals = {rival: (each.error_of(rival), each.skill(rival)) for rival in each.rivals}
                result.append(Skill(what, name, len(each.figures), each.error, rivals))
    return result


def agreements(
    subsets: SubsetComparison, responses: Sequence[DoseResponse], variants: Sequence[str]
) -> list[RankAgreement]:
    """Return the agreement over all conditions of each variant."""
    result = []
    for name in variants:
        figures = (*subsets.single[name].values(), *(each.pcp for each in responses if each.variant == name))
        of = Forecasts(figures)
        real, twin = of.real, of.twin
        ranks = rankdata(real, axis=1), rankdata(twin, axis=1)
        result.append(
            RankAgreement(
                name,
                len(figures),
                _resampled(_correlation(real, twin), greatest=1.0),
                _resampled(_correlation(*ranks), greatest=1.0),
                _resampled(rank_violation(real, twin), least=0.0),
            )
        )
    return result


def rank_violation(real: Floats, twin: Floats) -> Floats:
    """Return the mean maximum rank violation (...) of predicted figures (..., n), in the unit of the measured ones."""
    apart = real[..., :, None] - real[..., None, :]
    violated = (apart > 0) != (twin[..., :, None] - twin[..., None, :] > 0)
    return np.asarray(np.where(violated, np.abs(apart), 0.0).max(axis=-1, initial=0.0).mean(axis=-1))


def _correlation(one: Floats, other: Floats) -> Floats:
    """Return the correlations over the last axis; NaN where one side is constant."""
    one, other = (each - each.mean(axis=-1, keepdims=True) for each in (one, other))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((one * other).sum(axis=-1) / np.sqrt((one**2).sum(axis=-1) * (other**2).sum(axis=-1)))


def _resampled(values: Floats, *, least: float = -np.inf, greatest: float = np.inf) -> Interval:
    """Return the first value with its interval: the spread of the others about their mean.

    Resamples add their noise once more, which moves errors up, and skill and correlations down, as the noise of the
    value itself does. The end away from this shift is moved by it, so that the interval also holds the value without
    noise.
    """
    value, drawn = float(values[0]), values[1:][np.isfinite(values[1:])]
    if not len(drawn):
        return Interval(value, np.nan, np.nan, 1)
    shift = float(drawn.mean()) - value
    low, high = (float(end) - float(drawn.mean()) + value for end in interval(drawn))
    low, high = low - max(shift, 0.0), high - min(shift, 0.0)
    return Interval(value, max(min(low, value), least), min(max(high, value), greatest), 1)
