"""Inference of the parameters of a detector from what is measured of it, by simulation.

What is measured is not the parameter behind it: the consensus of few views has noise, and errors of other views in it.
Indirect inference (Gourieroux, Monfort & Renault, Journal of Applied Econometrics 1993) removes this without a formula
for each value: detections are simulated and measured in the same way as the recording. Around the present parameters
the measured values are linear in them, on scales without bounds. Levels and slopes follow from pairs of simulations
whose draws are the same and whose parameters differ, each up or down at random (simultaneous perturbation, Spall, IEEE
Transactions on Automatic Control 1992); parameters of one kind of joint act on each other's measured values alike for
all kinds. A Gaussian prior takes over where slopes or counts say little. The result is the mean of the posterior, with
its interval.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.special import expit, logit

from mvpose.arrays import Floats
from simharness.reality.detector_fit.detector_measurement import MeasuredValue
from simharness.scenario.sections.detector_section import KINDS
from simharness.types.random_streams import stream

ROUNDS = 7
"""Pairs of simulations, and single ones after them."""

Scale = Literal["logit", "log", "fisher"]

Scales = Mapping[Scale, tuple[str, ...]]

SCALES: Scales = {
    "logit": (
        *("keypoints.jitter", "keypoints.miss", "keypoints.inversion.", "keypoints.swap", "keypoints.stray"),
        *("keypoints.guess.self_occluded", "keypoints.guess.occluded", "correlation.scatter_noise"),
        *("scores.good", "scores.jitter", "scores.miss", "scores.inversion", "scores.swap", "scores.hidden"),
        *("scores.guess", "scores.overconfident", "scores.underconfident"),
    ),
    "log": (
        *("keypoints.scatter", "keypoints.self_occluded", "keypoints.occluded", "keypoints.inversion_reach"),
        *("correlation.life", "correlation.scatter_life", "boxes.life", "phantoms.rate", "scores.deviation"),
    ),
    "fisher": (
        *("correlation.views", "correlation.gross_views", "correlation.limb", "correlation.scatter_near"),
        *("correlation.scatter_views", "boxes.missed_views"),
    ),
}
"""Inferred parameters of a recording by their scale and the beginning of their keys: shares, amounts, and correlations,
which are on the inverse hyperbolic tangent; measured ones may be below 0."""

_WIDTH = 0.7
_WIDTHS = {"keypoints.guess": 1.2, "scores.hidden": 0.4, **dict.fromkeys(SCALES["fisher"], 0.35)}
"""Standard deviation of the prior on the scale, and other ones by the beginning of the keys."""

_ALIKE = (
    *("keypoints.jitter.", "keypoints.miss.", "keypoints.inversion.", "keypoints.swap.", "keypoints.scatter."),
    *("keypoints.self_occluded.", "keypoints.occluded."),
)
_COMMON, _COMMON_USUAL = 1.0, 0.3
"""Standard deviation, on the scale, of what a parameter of all kinds of joints has in common beside its prior, of those
that begin so and of the others: a detector may have fewer errors than the shipped one in all kinds alike."""

_PERTURBATIONS: Mapping[Scale, float] = {"logit": 0.5, "log": 0.3, "fisher": 0.15}
_OF_PAIR = 1e-3  # weight of the levels of a pair
_STEP = 1.0  # largest change in a round, on the scale
_NORMAL = 1.96  # deviations from the mean to the ends of a 95 % interval
_ONE_SIDED = 1.645  # deviations to the one end of a 95 % interval
_LEAST = 2e-4  # of a share
_SMALLEST = 1e-3  # of an amount
_STRONGEST = 0.95  # correlation
_PRIORS_SHARE = 0.85  # of the prior's deviation, from which a parameter is the prior's
_OWN, _OWN_SPREAD, _STEEPEST = 0.7, 0.4, 1.5
"""Usual slope of a measured value by its parameter, its spread, and its bound."""

_OTHER_SPREAD, _KIND_SPREAD, _SAME = 0.15, 0.2, 1e-3
"""Spread of slopes by other parameters; of the slopes of one kind of joint about those of all, by the parameter and by
others."""

_MOST = 9.0
"""Largest square of a difference in standard deviations that counts."""

_SLIGHT = 0.12  # slope by another parameter, below which it is noise


def infer(
    measured: Mapping[str, MeasuredValue],
    simulate: Callable[[Mapping[str, float], int], Mapping[str, float]],
    prior: Mapping[str, float],
    *,
    rounds: int = ROUNDS,
    scales: Scales = SCALES,
) -> dict[str, MeasuredValue]:
    """Return the parameters at which simulated detections measure as the real ones, with their 95 % intervals.

    Args:
        measured: measured values by key. Those that are not inferred stay; inferred ones that are unknown are the
            prior's.
        simulate: function from parameters and the number of a draw to the measured values of simulated detections.
        prior: most likely values before the measurement, by key; keys without one have no prior.
        rounds: number of pairs of simulations, and of single ones after them.
        scales: inferred parameters.
    """
    found = (_parameter(key, value, prior.get(key, 0.0), scales) for key, value in measured.items())
    parameters = [each for each in found if each is not None]
    if not parameters or not rounds:
        return dict(measured)
    state = _Inference(tuple(parameters))
    fixed = {key: each.value for key, each in measured.items()}
    for number in range(rounds):
        moves = np.array([each.step * stream(number, "inference", each.tie).choice([-1.0, 1.0]) for each in parameters])
        state.keep_inside()
        state.add(moves, *(simulate({**fixed, **state.values(side * moves)}, number) for side in (1.0, -1.0)))
    for number in range(rounds, 2 * rounds):
        state.add(np.zeros(len(parameters)), simulate({**fixed, **state.values()}, number))
    deviation = state.posterior()[1]
    ends = [state.values(side * _NORMAL * deviation) for side in (-1.0, 0.0, 1.0)]
    result = dict(measured)
    for each, unsure in zip(parameters, deviation > _PRIORS_SHARE * state.prior_deviation, strict=True):
        low, value, high = (end[each.key] for end in ends)
        result[each.key] = replace(measured[each.key], value=value, low=low, high=high, by_prior=bool(unsure))
    return result


def misfit(measured: Mapping[str, MeasuredValue], simulated: Mapping[str, float]) -> float:
    """Return the mean squared difference of simulated from measured values in standard deviations of their difference.

    Over the parameters of :data:`SCALES`; each counts :data:`_MOST` at most, so that no single one decides.
    """
    squares = []
    for key, each in measured.items():
        parameter = _parameter(key, each, 0.5, SCALES)
        if parameter is not None and np.isfinite(parameter.observed) and np.isfinite(simulated.get(key, np.nan)):
            away = (parameter.scaled(simulated[key]) - parameter.observed) / (np.sqrt(2) * parameter.deviation)
            squares.append(min(away**2, _MOST))
    return float(np.mean(squares)) if squares else np.nan


@dataclass(frozen=True)
class _Parameter:
    """Inferred parameter, all numbers on its scale."""

    key: str
    """Its key."""
    scale: Scale
    """Its scale."""
    least: float
    """Smallest value that is told from 0, on no scale."""
    prior: float
    """Most likely place before the measurement; NaN without a prior."""
    observed: float
    """Measured value of the recording; NaN where unknown."""
    deviation: float
    """Standard deviation of the measured value."""

    @property
    def step(self) -> float:
        """Perturbation in simulations."""
        return _PERTURBATIONS[self.scale]

    @property
    def group(self) -> str:
        """Key without the kind of joint or the bearing."""
        start, _, last = self.key.rpartition(".")
        return start if last in KINDS or last.isdigit() else self.key

    @property
    def kind(self) -> str:
        """Kind of joint; empty for parameters of all."""
        last = self.key.rpartition(".")[2]
        return last if last in KINDS else ""

    @property
    def tie(self) -> str:
        """Name of what is perturbed together: one value is measured for strays of all kinds of joints."""
        return self.group if self.key.startswith("keypoints.stray") else self.key

    def scaled(self, value: float) -> float:
        """Return a value on the scale."""
        if self.scale == "log":
            return float(np.log(max(value, self.least)))
        if self.scale == "fisher":
            return float(np.arctanh(np.clip(value, -_STRONGEST, _STRONGEST)))
        return float(logit(np.clip(value, self.least, 1 - self.least)))

    def value(self, place: float) -> float:
        """Return the value at a place on the scale."""
        if self.scale == "fisher":
            return float(np.clip(np.tanh(place), 0.0, _STRONGEST))
        return float(np.exp(place) if self.scale == "log" else expit(place))


def _parameter(key: str, measured: MeasuredValue, prior: float, scales: Scales) -> _Parameter | None:
    """Return the parameter of a key; None if it is not inferred, or if nothing is known of it."""
    scale = next((scale for scale, starts in scales.items() if key.startswith(starts)), None)
    if scale is None:
        return None
    n = measured.count
    least = max(_LEAST, 0.5 / (n + 1)) if scale == "logit" else _SMALLEST
    result = _Parameter(key, scale, least, np.nan, np.nan, 1.0)
    if prior > 0:
        result = replace(result, prior=result.scaled(prior))
    if measured.known and n > 0 and (prior > 0 or measured.value > least):
        ends = [result.scaled(each) for each in (measured.low, measured.high) if np.isfinite(each)]
        k = n * min(max(measured.value, 0.0), 1.0)
        counted = np.sqrt(1 / (k + 0.5) + 1 / (n - k + 0.5)) if scale == "logit" else np.sqrt(0.5 / n)
        observed = result.scaled(measured.value)
        deviation = max(float(np.ptp(ends or [0.0])) / (2 * _NORMAL), float(counted))
        if scale == "logit" and measured.value == 0 and np.isfinite(measured.high):  # the interval has one end
            deviation = max((result.scaled(measured.high) - observed) / _ONE_SIDED, 0.5)
        result = replace(result, observed=observed, deviation=deviation)
    return result if np.isfinite(result.prior) or np.isfinite(result.observed) else None


@dataclass
class _Inference:
    """Present parameters, and all rounds of one or two simulations so far, N parameters."""

    parameters: tuple[_Parameter, ...]
    places: list[Floats] = field(default_factory=list)
    """Parameters in each round, (N,)."""
    moves: list[Floats] = field(default_factory=list)
    """Perturbations in each round, (N,); 0 in those of one simulation."""
    levels: list[Floats] = field(default_factory=list)
    """Mean measured values of each round, (N,); NaN where unknown."""
    changes: list[Floats] = field(default_factory=list)
    """Half differences of the measured values of each pair, (N,); 0 in rounds of one simulation."""

    def __post_init__(self) -> None:
        self.prior = np.array([each.prior for each in self.parameters])
        self.observed = np.array([each.observed for each in self.parameters])
        self.at = np.where(np.isfinite(self.observed), self.observed, self.prior)
        self.inverse, self.prior_deviation = self._of_prior()

    def _of_prior(self) -> tuple[Floats, Floats]:
        """Return the inverse covariance of the prior, (N, N), and its deviations, (N,); without a prior 0, infinite."""
        index = np.flatnonzero(np.isfinite(self.prior))
        known = [self.parameters[each] for each in index]
        widths = [next((w for start, w in _WIDTHS.items() if each.key.startswith(start)), _WIDTH) for each in known]
        covariance = np.diag(np.square(widths))
        for row, one in enumerate(known):
            common = (_COMMON if one.key.startswith(_ALIKE) else _COMMON_USUAL) if one.group != one.key else 0.0
            covariance[row] += [common**2 * (one.group == other.group) for other in known]
        result, deviation = np.zeros((len(self.parameters),) * 2), np.full(len(self.parameters), np.inf)
        result[np.ix_(index, index)], deviation[index] = np.linalg.inv(covariance), np.sqrt(np.diag(covariance))
        return result, deviation

    def keep_inside(self) -> None:
        """Move correlations so far from 0 that both perturbations of a pair act."""
        for index, each in enumerate(self.parameters):
            if each.scale == "fisher":
                self.at[index] = max(self.at[index], each.step)

    def values(self, change: Floats | float = 0.0) -> dict[str, float]:
        """Return the present parameters, or those at a distance, (N,) on their scales, by key."""
        return {each.key: each.value(place) for each, place in zip(self.parameters, self.at + change, strict=True)}

    def add(self, moves: Floats, *simulated: Mapping[str, float]) -> None:
        """Add the measured values of one or two simulations, and move towards the mean of the posterior."""
        measured = np.array([[each.scaled(of.get(each.key, np.nan)) for each in self.parameters] for of in simulated])
        self.places.append(self.at.copy())
        self.moves.append(moves)
        self.levels.append(measured.mean(axis=0))
        self.changes.append((measured[0] - measured[-1]) / 2)
        self.at = self.at + np.clip(self.posterior()[0] - self.at, -_STEP, _STEP)
        fisher = np.array([each.scale == "fisher" for each in self.parameters])
        self.at[fisher] = np.maximum(self.at[fisher], 0.0)

    def posterior(self) -> tuple[Floats, Floats]:
        """Return mean and standard deviation of the parameters, (N,) each."""
        slopes = self._slopes()
        levels = np.array(self.levels) - np.array(self.places) @ slopes.T
        # Rounds near the end count more, where all parameters were near to theirs; pairs, which are perturbed, hardly.
        weight = (np.arange(len(levels)) + 1.0) ** 2 * np.where(np.any(self.moves, axis=1), _OF_PAIR, 1.0)
        weight = np.where(np.isfinite(levels), weight[:, None], 0.0)
        weight = weight / np.maximum(weight.sum(axis=0), 1e-9)
        level = (weight * np.nan_to_num(levels)).sum(axis=0)
        # Resamples of a recording without an event do not vary; simulations do.
        spread = (weight * (np.nan_to_num(levels) - level) ** 2).sum(axis=0) * (len(levels) > 2)
        variance = np.maximum(np.array([each.deviation for each in self.parameters]) ** 2, spread)
        variance = variance * (1 + (weight**2).sum(axis=0))
        known = np.isfinite(self.observed) & (weight.sum(axis=0) > 0)
        slopes = np.where(known[:, None], slopes, 0.0)
        weighed = slopes.T / variance
        information = weighed @ slopes + self.inverse + 1e-6 * np.eye(len(level))
        pull = weighed @ np.where(known, self.observed - level, 0.0) + self.inverse @ np.nan_to_num(self.prior)
        pull = pull + 1e-6 * self.at
        return np.linalg.solve(information, pull), np.sqrt(np.diag(np.linalg.inv(information)))

    def _slopes(self) -> Floats:
        """Return the slope of each measured value by each parameter, (N, N), by ridge regression over all pairs.

        Those of parameters of one kind of joint are much alike for all kinds; parameters of all joints act on their own
        measured values alone.
        """
        moves, changes = np.array(self.moves), np.array(self.changes)
        result = np.zeros((len(self.parameters),) * 2)
        groups: dict[str, list[int]] = {}
        for index, each in enumerate(self.parameters):
            groups.setdefault(each.group, []).append(index)
        of_kinds = [group for group, rows in groups.items() if self.parameters[rows[0]].kind]
        place = {(each.group, each.kind): index for index, each in enumerate(self.parameters)}
        padded = np.concatenate([moves, np.zeros((len(moves), 1))], axis=1)
        for group, rows in groups.items():
            columns = of_kinds if group in of_kinds else [group]
            own = np.array([group == each for each in columns])
            cells = [
                [place.get((other, self.parameters[row].kind), -1) if group in of_kinds else row for other in columns]
                for row in rows
            ]
            every = np.concatenate([padded[:, each] for each in cells]), np.concatenate([changes[:, r] for r in rows])
            pooled = _ridge(*every, _OWN * own, np.where(own, _OWN_SPREAD, _OTHER_SPREAD))
            for row, cell in zip(rows, cells, strict=True):
                slopes = _ridge(padded[:, cell], changes[:, row], pooled, np.where(own, _KIND_SPREAD, _SAME))
                slopes[own] = np.clip(slopes[own], 0.0, _STEEPEST)
                slopes[~own & (np.abs(slopes) < _SLIGHT)] = 0.0
                shown = np.array(cell) >= 0
                result[row, np.array(cell)[shown]] = slopes[shown]
        return result


def _ridge(design: Floats, change: Floats, usual: Floats, spread: Floats) -> Floats:
    """Return slopes (C,) that explain changes (n,) by perturbations (n, C), with a prior of mean and spread (C,)."""
    known = np.isfinite(change)
    design, change = design[known], change[known]
    noise = float(np.mean((change - design @ usual) ** 2)) + 1e-6 if len(change) else 1.0
    left = design.T @ design / noise + np.diag(spread**-2)
    return np.asarray(np.linalg.solve(left, design.T @ change / noise + usual / spread**2))
