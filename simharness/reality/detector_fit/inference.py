"""Inference of the parameters of a detector from what is measured of it, by simulation.

What is measured is not the parameter behind it: the consensus of few views has noise, and errors of other views in it.
Indirect inference (Gourieroux, Monfort & Renault, Journal of Applied Econometrics 1993) removes this without a formula
for each value: detections are simulated and measured in the same way as the recording. Around the present parameters
the measured values are linear in them, on scales without bounds. Slopes follow from simulations with the same draws in
which the parameters of one group are moved, those of all kinds of joints at once, because they act on the measured
values of their own kind. A Gaussian prior takes over where slopes or counts say little. The result is the mean of the
posterior, with its interval.

A measured value varies as the bootstrap of the recording says, or, where errors last longer than the blocks of the
bootstrap, as it does between simulations at the result.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.special import expit, logit

from mvpose.arrays import Floats
from simharness.reality.detector_fit.detector_measurement import MeasuredValue
from simharness.reality.detector_fit.parameters import SHARES, STATES
from simharness.reality.detector_fit.visibility_errors import (
    independent,
    measured_parameters,
    prior_shares,
    with_parameters,
)
from simharness.scenario.sections.detector_section import KINDS

ROUNDS = 8
"""Simulations before the slopes are found, and after."""

Scale = Literal["logit", "log", "factor", "fisher", "linear"]

Scales = Mapping[Scale, tuple[str, ...]]

SCALES: Scales = {
    "logit": (
        *("keypoints.jitter", "keypoints.miss", "keypoints.inversion.", "keypoints.swap.", "keypoints.stray"),
        *("keypoints.guess.self_occluded", "keypoints.guess.occluded", "correlation.scatter_noise"),
        *("keypoints.drop.edge", "keypoints.drop.self_occluded", "keypoints.drop.occluded"),
        "boxes.missed_hidden",
        *("scores.good", "scores.jitter", "scores.miss", "scores.inversion", "scores.swap", "scores.hidden"),
        *("scores.guess", "scores.overconfident", "scores.underconfident"),
    ),
    "log": (
        *("keypoints.scatter", "keypoints.self_occluded", "keypoints.occluded", "keypoints.inversion_reach"),
        "keypoints.drop.depth",
        *("correlation.life", "correlation.scatter_life", "boxes.life", "phantoms.rate", "scores.deviation"),
    ),
    "factor": ("keypoints.inversion_uncovered", "keypoints.swap_uncovered"),
    "linear": SHARES,
    "fisher": (
        *("correlation.views", "correlation.gross_views", "correlation.limb", "correlation.scatter_near"),
        *("correlation.scatter_views", "boxes.missed_views"),
    ),
}
"""Inferred parameters of a recording by their scale and the beginning of their keys: shares, amounts, factors of 1 at
most, and correlations, which are on the inverse hyperbolic tangent; measured ones may be below 0. Shares of joints by
their state are linear: the measured ones are mixtures of those of all states, because some joints are not in the state
in which they seem. Of visible joints that hardly ever err, they are mostly hidden ones', which no scale without bounds
can tell."""

_WIDTHS = {
    **dict.fromkeys(SCALES["fisher"], (0.35, 0.0)),
    **dict.fromkeys(SCALES["log"], (0.7, 0.0)),
    **dict.fromkeys(SCALES["factor"], (1.75, 0.0)),
    **dict.fromkeys(("keypoints.self_occluded", "keypoints.occluded"), (1.0, 1.0)),
    "keypoints.scatter": (0.2, 0.5),
    "keypoints.jitter_mean": (0.6, 0.6),
}
"""Standard deviations of the prior on the scale, of each parameter and of what the kinds of joint have in common, by
the beginning of the keys: by so much the fits to MoveNet and OpenPose differ from the shipped profiles. Factors of
uncovered joints are .005 (inversions of OpenPose on Shelf) to .6 (swaps of MoveNet), and 1 in shipped profiles."""

_WIDTH = (1.0, 1.0)  # of the others, which are shares

_PERTURBATIONS: Mapping[Scale, float] = {"logit": 0.5, "log": 0.3, "factor": 0.5, "fisher": 0.3}
_LINEAR_STEP = 4.0  # deviations of the measured values
_APART = 0.2
"""Distance of the left-right counterpart, heights of the box, at which inversions are inferred: joints that are told
from their counterpart are about so far from it. Shares at no distance are extrapolated with the reach."""

_BY_SHARE = {"keypoints.inversion": "share.inversion", "keypoints.swap": "share.swap"}
"""Groups of parameters that are inferred as the shares of joints that nothing else hides, from the measured shares of
all joints: most joints are such, and few say by which factor the shares of the others, those of the profile, are
larger."""

_DROPS = tuple(f"keypoints.drop.{state}" for state in STATES)
_OF_DROPS = ("keypoints.drop.edge", "keypoints.drop.depth")  # without effect where no joint is dropped

_AMOUNTS = ("phantoms.life", "phantoms.deviation", "scores.joint", "keypoints.border", "size")
"""Values that are not inferred, and are no shares."""

_ANEW = tuple(f"correlation.{key}" for key in ("life", "views", "gross_views", "limb")) + (
    "boxes.life",
    "boxes.missed_views",
)
"""Parameters by which errors are drawn anew. They change no share: the marginal distributions are exact."""

_NOISE, _NOISE_ANEW = 0.4, 1.2
"""Noise of changes between simulations with the same draws, and with others, deviations of the measured values."""

_TOLD = 2.0  # least significance of a cross slope, deviations
_STEP = 1.0  # largest change in a round, on the scale
_NORMAL = 1.96  # deviations from the mean to the ends of a 95 % interval
_ONE_SIDED = 1.645  # deviations to the one end of a 95 % interval
_LASTING = 3.0  # joints, about, of one error that lasts
_LEAST, _SMALLEST = 2e-4, 1e-3  # of a share, and of an amount
_STRONGEST = 0.95  # correlation
_PRIORS_SHARE = 0.85  # of the prior's deviation, from which a parameter is the prior's
_OWN, _STEEPEST = 0.7, 1.5  # usual slope of a measured value by its parameter, and its bound
_BENT, _FAR = 3.0, 0.8  # least significance of a changed slope, deviations, and least move, on the scale
_SPREAD, _KIND_SPREAD = 0.4, 0.2  # of slopes about the usual ones, and of those of one kind of joint about all
_SCORED = ("good", "jitter", "miss", "inversion", "swap")

_MOST = 9.0
"""Largest square of a difference in standard deviations that counts."""


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
        rounds: number of simulations before the slopes are found, and after.
        scales: inferred parameters.
    """
    prior = prior_shares(prior)
    parameters = _parameters(measured, prior, scales)
    if not parameters or not rounds:
        return dict(measured)
    state = _Inference(tuple(parameters))
    fixed = {key: each.value for key, each in measured.items()}
    simulated: list[Mapping[str, float]] = []

    def run(change: Floats | float, draw: int) -> Floats:
        of = simulate(with_parameters({**fixed, **state.values(change)}), draw)
        simulated.append(of)
        return np.array([each.seen(of.get(each.measured_by, np.nan)) for each in parameters])

    for draw in range(rounds):
        state.add(run(0.0, draw))
    state.find_slopes(lambda change: run(change, rounds))
    for draw in range(rounds, 2 * rounds):
        state.add(run(0.0, draw))
    result = _as_wide_as_simulated(measured, simulated[-rounds:])
    deviation = state.posterior()[1]
    reach = np.diag(_NORMAL * state.of_values(deviation))
    unsure = deviation > _PRIORS_SHARE * state.prior_deviation
    unsure |= state.uncovered @ unsure > 0
    for index, each in enumerate(parameters):
        low, value, high = (state.values(side * reach[index])[each.key] for side in (-1.0, 0.0, 1.0))
        result[each.key] = replace(measured[each.key], value=value, low=low, high=high, by_prior=bool(unsure[index]))
    shares = {key: each for key, each in measured.items() if key.startswith(SHARES)}
    return {**result, **measured_parameters(result), **shares}


def _as_wide_as_simulated(
    measured: Mapping[str, MeasuredValue], simulated: Sequence[Mapping[str, float]]
) -> dict[str, MeasuredValue]:
    """Return measured values with intervals as wide as they vary between simulations, alike for kinds of joint."""
    groups: dict[str, dict[str, float]] = defaultdict(dict)
    for key, each in measured.items():
        values = np.array([of.get(key, np.nan) for of in simulated])
        deviation = (each.high - each.low) / (2 * _NORMAL)
        if len(values) > 1 and np.isfinite(values).all() and deviation > 0:
            start, _, last = key.rpartition(".")
            groups[start if last in KINDS else key][key] = float(values.var(ddof=1) / deviation**2)
    result = dict(measured)
    for ratios in groups.values():
        factor = np.sqrt(max(1.0, float(np.mean(list(ratios.values())))))
        for key in ratios:
            each = measured[key]
            low, high = (each.value + factor * (end - each.value) for end in (each.low, each.high))
            most = np.inf if key.startswith(_AMOUNTS) else max(1.0, each.high)
            result[key] = replace(each, low=float(max(low, min(each.low, 0.0))), high=float(min(high, most)))
    return result


def misfit(measured: Mapping[str, MeasuredValue], simulated: Mapping[str, float]) -> float:
    """Return the mean squared difference of simulated from measured values in standard deviations of their difference.

    Over the parameters of :data:`SCALES`; each counts :data:`_MOST` at most, so that no single one decides.
    """
    squares = []
    for each in _parameters(measured, dict.fromkeys(measured, 0.5), SCALES):
        value = simulated.get(each.measured_by, np.nan)
        if np.isfinite(each.observed) and np.isfinite(value):
            away = (each.seen(value) - each.observed) / (np.sqrt(2) * each.deviation)
            squares.append(min(away**2, _MOST))
    return float(np.mean(squares)) if squares else np.nan


@dataclass(frozen=True)
class _Parameter:
    """Inferred parameter, all numbers on its scale."""

    key: str
    """Its key."""
    measured_by: str
    """Key of the measured value that says most of it."""
    scale: Scale
    """Its scale."""
    prior: float
    """Most likely place before the measurement; NaN without a prior."""
    observed: float
    """Measured value of the recording; NaN where unknown."""
    deviation: float
    """Standard deviation of the measured value."""
    count: int
    """Number of joints, people or detections behind it."""
    recorded: float
    """Measured value of the recording, not on the scale."""

    @property
    def group(self) -> str:
        """Key without the kind of joint, or the class of a score."""
        return self.key.rpartition(".")[0] if self.kind else self.key

    @property
    def kind(self) -> str:
        """Kind of joint, or class of a score; empty for parameters of all."""
        start, _, last = self.key.rpartition(".")
        return last if last in (_SCORED if start in ("scores", "scores.hidden") else KINDS) else ""

    def scaled(self, value: float) -> float:
        """Return a value on the scale."""
        if self.scale in ("log", "factor"):
            return float(np.log(max(value, _SMALLEST)))
        if self.scale == "linear":
            return float(value)
        if self.scale == "fisher":
            return float(np.arctanh(np.clip(value, -_STRONGEST, _STRONGEST)))
        return float(logit(np.clip(value, _LEAST, 1 - _LEAST)))

    def seen(self, value: float) -> float:
        """Return a measured value on the scale; shares with the weight of _LASTING, as there may be no event."""
        if self.scale == "logit":
            value = (max(value, 0.0) * self.count + _LASTING) / (self.count + 2 * _LASTING)
        return self.scaled(value)

    def value(self, place: float) -> float:
        """Return the value at a place on the scale."""
        if self.scale == "linear":
            return float(np.clip(place, _LEAST, 1 - _LEAST))
        if self.scale == "fisher":
            return float(np.clip(np.tanh(place), 0.0, _STRONGEST))
        if self.scale == "factor":
            return float(np.exp(min(place, 0.0)))
        return float(np.exp(place) if self.scale == "log" else expit(place))


def _parameters(measured: Mapping[str, MeasuredValue], prior: Mapping[str, float], scales: Scales) -> list[_Parameter]:
    """Return the parameters that are inferred, and of which the recording or the prior says something."""
    dropped = any(each.value > 0 for key, each in measured.items() if key.startswith(_DROPS))
    result = []
    for key in independent(measured):
        group, _, kind = key.rpartition(".")
        by = f"{_BY_SHARE.get(group, group)}.{kind}"
        by = by if by in measured else key
        scale = next((scale for scale, starts in scales.items() if key.startswith(starts)), None)
        if scale is not None and (dropped or not key.startswith(_OF_DROPS)):
            result.append(_parameter(key, by, measured[by], prior.get(key, 0.0), scale))
    return [each for each in result if np.isfinite(each.prior) or np.isfinite(each.observed)]


def _parameter(key: str, measured_by: str, measured: MeasuredValue, prior: float, scale: Scale) -> _Parameter:
    """Return a parameter by the measured value that says most of it."""
    n = measured.count
    result = _Parameter(key, measured_by, scale, np.nan, np.nan, 1.0, n, measured.value)
    if prior > 0:
        result = replace(result, prior=result.scaled(prior))
    if measured.known and n > 0 and (prior > 0 or measured.value > 0):
        ends = [result.seen(each) for each in (measured.low, measured.high) if np.isfinite(each)]
        k = n * min(max(measured.value, 0.0), 1.0)
        counted = np.sqrt(1 / (k + _LASTING) + 1 / (n - k + _LASTING)) if scale == "logit" else np.sqrt(0.5 / n)
        observed = result.seen(measured.value)
        if scale == "linear":
            counted = np.sqrt((k + 1) * (n - k + 1) / (n + 2) ** 3)
        deviation = max(float(np.ptp(ends or [0.0])) / (2 * _NORMAL), float(counted))
        if scale == "logit" and measured.value == 0 and np.isfinite(measured.high):  # the interval has one end
            deviation = max((result.seen(measured.high) - observed) / _ONE_SIDED, 0.5)
        result = replace(result, observed=observed, deviation=deviation)
    return result


@dataclass
class _Inference:
    """Present parameters, and all simulations with them so far, N parameters."""

    parameters: tuple[_Parameter, ...]
    places: list[Floats] = field(default_factory=list)
    """Parameters in each simulation, (N,)."""
    measured: list[Floats] = field(default_factory=list)
    """Measured values of each simulation, (N,); NaN where unknown."""

    def __post_init__(self) -> None:
        self.prior = np.array([each.prior for each in self.parameters])
        self.observed = np.array([each.observed for each in self.parameters])
        self.deviation = np.array([each.deviation for each in self.parameters])
        self.at = np.where(np.isfinite(self.prior), self.prior, self.observed)
        scales = np.array([each.scale for each in self.parameters])
        self.least = np.where(scales == "fisher", 0.0, np.where(scales == "linear", _LEAST, -np.inf))
        self.most = np.where(scales == "linear", 1 - _LEAST, np.where(scales == "factor", 0.0, np.inf))
        self.at = np.clip(self.at, self.least, self.most)
        self.slopes, self.found = _OWN * np.eye(len(self.parameters)), False
        self.reach = next((i for i, each in enumerate(self.parameters) if each.key == "keypoints.inversion_reach"), -1)
        self.apart = np.array([each.group == "keypoints.inversion" for each in self.parameters]) * (self.reach >= 0)
        uncovered = [[f"{each.group}_uncovered" == other.key for other in self.parameters] for each in self.parameters]
        self.uncovered = np.array(uncovered, float)
        self.groups: dict[str, dict[str, int]] = {}
        for index, each in enumerate(self.parameters):
            self.groups.setdefault(each.group, {})[each.kind] = index
        recorded = np.array([each.recorded for each in self.parameters])
        for rows in map(list, (each.values() for each in self.groups.values())):
            # One value that is measured for several kinds of joint counts once.
            alike = recorded[rows] == recorded[rows][:, None]
            self.deviation[rows] *= np.sqrt(np.maximum(alike.sum(axis=0), 1))
        self.inverse, self.prior_deviation = self._of_prior()

    def _of_prior(self) -> tuple[Floats, Floats]:
        """Return the inverse covariance of the prior, (N, N), and its deviations, (N,); without a prior 0, infinite."""
        index = np.flatnonzero(np.isfinite(self.prior))
        known = [self.parameters[each] for each in index]
        covariance = np.zeros((len(index),) * 2)
        for row, one in enumerate(known):
            own, common = next((each for start, each in _WIDTHS.items() if one.key.startswith(start)), _WIDTH)
            covariance[row] = [common**2 * bool(one.kind and one.group == other.group) for other in known]
            covariance[row, row] += own**2
        # The prior of a hidden share is relative to the visible one: the ratio of their odds.
        at = {each.key: row for row, each in enumerate(known)}
        over = [at.get(f"{SHARES[0]}.{each.kind}", -1) if each.group in SHARES[1:3] else -1 for each in known]
        sums = np.eye(len(index))
        sums[np.array(over) >= 0, [row for row in over if row >= 0]] = 1.0
        # Priors of linear shares are as wide as on the scale of their logit.
        sums *= [[each.prior * (1 - each.prior) if each.scale == "linear" else 1.0] for each in known]
        covariance = sums @ covariance @ sums.T
        result, deviation = np.zeros((len(self.parameters),) * 2), np.full(len(self.parameters), np.inf)
        result[np.ix_(index, index)], deviation[index] = np.linalg.inv(covariance), np.sqrt(np.diag(covariance))
        return result, deviation

    def values(self, change: Floats | float = 0.0) -> dict[str, float]:
        """Return the present parameters, or those at a distance, (N,) on their scales, by key."""
        place = self.at + change
        place = place + self.apart * _APART / np.exp(place[self.reach]) - self.uncovered @ np.minimum(place, 0.0)
        return {each.key: each.value(there) for each, there in zip(self.parameters, place, strict=True)}

    def of_values(self, deviation: Floats) -> Floats:
        """Return the deviations of the values, (N,): shares also depend on the reach and on the factor of uncovered."""
        by_reach = self.apart * _APART * deviation[self.reach] / np.exp(self.at[self.reach])
        return np.sqrt(deviation**2 + by_reach**2 + self.uncovered @ deviation**2)

    def add(self, measured: Floats) -> None:
        """Add the measured values of a simulation, (N,), and move towards the mean of the posterior."""
        self.places.append(self.at)
        self.measured.append(measured)
        self.at = np.clip(self.at + np.clip(self.posterior()[0] - self.at, -_STEP, _STEP), self.least, self.most)

    def find_slopes(self, run: Callable[[Floats | float], Floats]) -> None:
        """Find the slopes of all measured values by the parameters of each group; levels are found anew."""
        before, slopes = run(0.0), np.zeros_like(self.slopes)
        spread = self.deviation * np.sqrt(self._between())
        for group, columns in self.groups.items():
            index = list(columns.values())
            scale = self.parameters[index[0]].scale
            step = _PERTURBATIONS.get(scale) or _LINEAR_STEP * float(np.median(self.deviation[index]))
            moves = np.zeros(len(self.parameters))
            moves[index] = step
            change = (run(moves) - before) / step
            known, change = np.isfinite(change), np.nan_to_num(change)
            anew = group.startswith(_ANEW)
            noise = _NOISE_ANEW if anew else _NOISE
            for of, rows in self.groups.items():
                row, own = np.array(list(rows.values())), of == group
                weight = np.where(known[row] & (own or not anew), (step / (noise * spread[row])) ** 2, 0.0)
                usual = (weight @ change[row] + own * _OWN / _SPREAD**2) / (weight.sum() + _SPREAD**-2)
                sure = weight + _KIND_SPREAD**-2
                slope = (weight * change[row] + usual / _KIND_SPREAD**2) / sure
                # A cross slope counts where it is significant for its kind of joint, or pooled over all kinds.
                alike = usual**2 * (weight.sum() + _SPREAD**-2) >= _TOLD**2
                slope[slope**2 * sure < (1.0 if own else _TOLD**2 * (not alike))] = 0.0
                for each, place in zip(np.clip(slope, 0.0, _STEEPEST) if own else slope, row, strict=True):
                    by = [columns[kind]] if (kind := self.parameters[place].kind) in columns else index
                    slopes[place, by] = each / len(by)
        self.slopes, self.places, self.measured, self.found = slopes, [], [], True

    def posterior(self) -> tuple[Floats, Floats]:
        """Return mean and standard deviation of the parameters, (N,) each."""
        levels, weight, slopes = self._levels()
        level, known = (weight * levels).sum(axis=0), np.isfinite(self.observed) & (weight.sum(axis=0) > 0)
        variance = self.deviation**2 * self._more(levels, weight) * (1 + (weight**2).sum(axis=0))
        weighed = np.where(known[:, None], slopes, 0.0).T / variance
        information = weighed @ slopes + self.inverse + 1e-6 * np.eye(len(level))
        prior = self.inverse @ np.nan_to_num(self.prior) + 1e-6 * self.at
        pull = weighed @ np.where(known, self.observed - level, 0.0) + prior
        return np.linalg.solve(information, pull), np.sqrt(np.diag(np.linalg.inv(information)))

    def _levels(self) -> tuple[Floats, Floats, Floats]:
        """Return the levels of simulations, 0 where unknown, and their weights, (n, N) each, and the slopes, (N, N).

        Where a parameter has moved far since its slope was found, the slope is that of a regression over its places.
        """
        places = np.array(self.places)
        levels = np.array(self.measured) - places @ self.slopes.T
        # Later simulations weigh more: their parameters are nearer to the result.
        weight = np.where(np.isfinite(levels), (np.arange(len(levels)) + 1.0)[:, None] ** 2, 0.0)
        weight, levels = weight / np.maximum(weight.sum(axis=0), 1e-9), np.nan_to_num(levels)
        away, moved = (each - (weight * each).sum(axis=0) for each in (levels, places))
        both, square = (weight * moved * away).sum(axis=0), (weight * moved**2).sum(axis=0) + 1e-12
        alike = both**2 / square / ((weight * away**2).sum(axis=0) + 1e-12)  # squared correlation
        free = 1 / np.maximum((weight**2).sum(axis=0), 1e-9) - 2
        bent = self.found & (np.ptp(places, axis=0) > _FAR) & (alike * free > _BENT**2 * (1 - alike))
        bend, own = np.where(bent, both / square, 0.0), self.slopes.diagonal()
        bend = np.clip(own + bend, 0.0, _STEEPEST) - own
        return levels - places * bend, weight, self.slopes + np.diag(bend)

    def _more(self, levels: Floats, weight: Floats) -> Floats:
        """Return by how much variances between simulations exceed those of the recording's bootstrap, (N,), 1 or more.

        Kinds of joint are alike. Levels of simulations, and their weights: (n, N).
        """
        free = np.maximum(1 - (weight**2).sum(axis=0), 1e-9)
        away = levels - (weight * levels).sum(axis=0)
        ratio = (weight * away**2).sum(axis=0) / free / self.deviation**2
        result = np.ones(len(ratio))
        for rows in self.groups.values():
            index = list(rows.values())
            count = ((weight[:, index] > 0).sum(axis=0) - 1.0).clip(0.0)
            result[index] = max(1.0, (count @ ratio[index] + 1.0) / (count.sum() + 1.0))
        return result

    def _between(self) -> Floats:
        """Return the same of all simulations so far, (N,): the smaller of measured values' and of their levels'."""
        measured, places = np.array(self.measured), np.array(self.places)
        weight = np.isfinite(measured) / np.maximum(np.isfinite(measured).sum(axis=0), 1)
        either = (measured, measured - places @ self.slopes.T)
        return np.minimum(*(self._more(np.nan_to_num(each), weight) for each in either))
