"""Blame that decides: the share of each cause in a lost score, and the fewest causes whose mending restores it.

The worth of a coalition of causes is the score of the same trial with these causes mended
(:class:`.mended_trial.MendedTrial`). Causes overlap: a joint that people hide is also guessed, and a person who is
missed in one view is less missed with one more camera. So a cause has three numbers:

- its gain alone: the score with only this cause mended, minus the score as it is. It answers what mending it is worth;
- its gain last: the score with everything mended, minus that with everything but this. Where it is zero, the other
  causes together make up for it;
- its share: the Shapley value, which is the mean gain over all orders in which the causes may be mended. Shares add up
  to the whole gain, and what is left of the loss is no cause's: few views, or the method itself.

Shapley values of n causes need 2^n scores. With up to :data:`EXACT` causes they are exact; of more they are estimated
at every seed from :data:`ORDERS` random orders and are as exact as their intervals tell, which hold both spreads.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from mvpose.arrays import Floats
from mvpose.commands.errors import RunError
from mvpose.commands.progress import Reporter, Silence, Stages
from mvpose.files.message_text import prefixed
from mvpose.json_values import json_value
from simharness.runtime.frame_pool import map_jobs
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import SCALES, Interval, Scale, mean_interval
from simharness.statistics.shapley import joining_orders, shapley_values, smallest_coalition, values_over_orders
from simharness.study.causes.cause_catalogue import CAUSES, Cause, MendedTrial, causes_by_name, present_causes
from simharness.trial.conditioned_trial import takes_labels
from simharness.trial.run_trial import with_variants
from simharness.trial.stages.build_trial import build_variants

EXACT = 5
"""Largest number of causes whose shares are exact."""

ORDERS = 4
"""Number of random orders of mending at every seed, where there are more causes; even, because each has its reverse."""

SEEDS = 10
"""Number of seeds by default."""

RESTORED = 0.9
"""Share of the possible gain from which on a set of mended causes has restored the score."""

CANDIDATES = 4
"""Number of causes among which the fewest that restore the score are looked for: those of the largest shares."""


@dataclass(frozen=True)
class Share:
    """What one cause costs."""

    cause: str
    """Name of the cause (:data:`simharness.study.causes.cause_catalogue.CAUSES`)."""
    share: Interval
    """Shapley value, points of the score."""
    alone: Interval
    """Gain if this cause alone is mended, points."""
    last: Interval
    """Gain if it is mended after all others, points."""

    @property
    def about(self) -> Cause:
        """The cause."""
        return causes_by_name([self.cause])[0]


@dataclass(frozen=True)
class Mending:
    """The fewest causes whose mending restores the score, or comes nearest to that."""

    causes: tuple[str, ...]
    """Names of the causes, the largest share first."""
    score: Interval
    """Score with these mended."""
    gain: Interval
    """Difference to the score as it is, points."""
    restored: float
    """Their share of the gain of mending all causes, 0 to 1; it may be a little above 1."""

    @property
    def about(self) -> tuple[Cause, ...]:
        """The causes."""
        return tuple(causes_by_name([name])[0] for name in self.causes)


@dataclass(frozen=True)
class Blame:
    """Result of :func:`blame`. Intervals are over the seeds; a single seed has none."""

    scenario: str
    """Name of the scenario."""
    setting: str
    """What was changed in it, for people; empty where nothing was."""
    variant: str
    """Variant of the method."""
    score: str
    """Key of the score."""
    seeds: tuple[int, ...]
    """The seeds."""
    before: Interval
    """The score as it is."""
    after: Interval
    """The score with all causes mended."""
    rest: Interval
    """What is lost with all causes mended, points."""
    shares: tuple[Share, ...]
    """Shares, the largest first; a gain is positive where the score becomes better."""
    mending: Mending | None
    """The fewest causes that restore the score; None where nothing is to be gained."""
    absent: tuple[str, ...]
    """Names of the causes that the scenario does not have."""

    def json(self) -> dict[str, Any]:
        """Return the fields, JSON-ready; an interval has its mean, its ends and the number of seeds."""
        fields: dict[str, Any] = json_value(asdict(self))
        return fields

    @classmethod
    def of_json(cls, data: Mapping[str, Any]) -> "Blame":
        """Return the result that :meth:`json` wrote.

        Raises:
            ValueError: other keys or values.
        """
        with prefixed("not a result of simharness blame"):
            found = TypeAdapter(cls).validate_python(data)
        causes_by_name([*(each.cause for each in found.shares), *(found.mending.causes if found.mending else ())])
        return found


def blame(
    scenario: Scenario,
    *,
    variant: str | None = None,
    seeds: int | Sequence[int] = SEEDS,
    score: str = "pcp",
    causes: Collection[str] | None = None,
    setting: str = "",
    workers: int = 1,
    reporter: Reporter | None = None,
) -> Blame:
    """Find what cost a scenario its score.

    Args:
        scenario: a resolved scenario.
        variant: preset of mvpose.Pipeline or estimator of the scenario; by default its first variant.
        seeds: the seeds, or their number, from that of the scenario on.
        score: key of the score.
        causes: names of the causes that may be mended; by default all that the scenario has.
        setting: what was changed in the scenario, for people.
        workers: processes that share the seeds; results do not depend on it.
        reporter: receiver of progress.

    Raises:
        ValueError: no such score, cause or variant, no seed, none of the causes is in the scenario, a scenario that
            cannot be built or whose score does not apply, or keypoints from a network, whose errors cannot be mended
            one by one.
        RunError: any error after that; the message names the seed.
    """
    if score not in SCORES:
        raise ValueError(f"score {score!r}: no such score; expected one of {', '.join(SCORES)}")
    seeds = tuple(range(scenario.seed, scenario.seed + seeds)) if isinstance(seeds, int) else tuple(seeds)
    if not seeds:
        raise ValueError("blame needs one seed or more, got none")
    if networks := scenario.detector.networks:
        raise ValueError(
            f"detector.{next(iter(networks))}: detections are those of a network, whose errors cannot be mended one by "
            "one; use a simulated detector"
        )
    scenario = with_variants(scenario, [variant or scenario.method.variants[0]])
    (variant, estimator), *_ = build_variants(scenario).items()
    wanted = CAUSES if causes is None else causes_by_name(tuple(causes))
    players = present_causes(scenario, wanted, labelled=takes_labels(estimator))
    if not players:
        raise ValueError(f"causes: {scenario.name} has none of {', '.join(cause.name for cause in wanted)}")
    names = tuple(cause.name for cause in players)
    game = _Game(scenario, variant, score, seeds, names)
    stages = Stages(reporter or Silence())
    with stages.stage("causes", len(seeds)) as advance:
        worths, values = game.play(workers, advance)
    sign = 1.0 if SCORES[score].better == "higher" else -1.0
    applies = np.isfinite(worths).all(axis=1)
    if not applies.any():
        raise ValueError(f"score {score!r}: at no seed of {scenario.name} does it apply with and without every cause")
    ranked = np.argsort(-sign * values[applies].mean(axis=0), kind="stable")[:CANDIDATES].tolist()
    with stages.stage("fewest causes", len(seeds)) as advance:
        sets = game.sets([names[k] for k in ranked], workers, advance)
    unit, best = SCORES[score].unit, 100.0 if sign > 0 else 0.0
    before, after, alone, last = worths[applies, :1], worths[applies, 1], *np.split(worths[applies, 2:], 2, axis=1)
    shares = [
        Share(
            name,
            difference_interval(sign * values[applies, k], unit),
            difference_interval(sign * (alone[:, k] - before[:, 0]), unit),
            difference_interval(sign * (after - last[:, k]), unit),
        )
        for k, name in enumerate(names)
    ]
    return Blame(
        scenario=scenario.name,
        setting=setting,
        variant=variant,
        score=score,
        seeds=seeds,
        before=mean_interval(before[:, 0], unit=unit),
        after=mean_interval(after, unit=unit),
        rest=mean_interval(sign * (best - after), unit=unit),
        shares=tuple(sorted(shares, key=lambda each: -each.share.mean)),
        mending=_mending(sets[applies], sign, sign * (after - before[:, 0]), [names[k] for k in ranked], unit),
        absent=tuple(cause.name for cause in wanted if cause not in players),
    )


@dataclass(frozen=True)
class _Game:
    """Causes as players, at every seed; trials are kept between calls in one process."""

    scenario: Scenario
    """The scenario."""
    variant: str
    """Variant of the method."""
    score: str
    """Key of the score."""
    seeds: tuple[int, ...]
    """The seeds."""
    names: tuple[str, ...]
    """Names of the n causes; a coalition is a bit mask of them."""

    def play(self, workers: int, advance: Any) -> tuple[Floats, Floats]:
        """Return worths of no cause, all, each alone, all but each, (seeds, 2 + 2n), and the values (seeds, n)."""
        rows = map_jobs(self, self._jobs("play", ()), workers=workers, progress=advance)
        worths, values = zip(*rows, strict=True)
        return np.array(worths), np.array(values)

    def sets(self, names: Sequence[str], workers: int, advance: Any) -> Floats:
        """Return the worth of every set of k causes, (seeds, 2^k) by bit mask."""
        return np.array(map_jobs(self, self._jobs("sets", tuple(names)), workers=workers, progress=advance))

    def _jobs(self, what: str, names: tuple[str, ...]) -> list[tuple[range, str, tuple[str, ...]]]:
        return [(range(k, k + 1), what, names) for k in range(len(self.seeds))]

    def __call__(self, which: range, what: str, names: tuple[str, ...]) -> Any:
        """Play at one seed, the one at this index."""
        seed = self.seeds[which.start]
        try:
            if seed not in self._trials:
                scenario = self.scenario.model_copy(update={"seed": seed})
                self._trials[seed] = MendedTrial(scenario, self.variant, score=self.score)
            worth = self._trials[seed].worth
            if what == "sets":
                return [worth(_of_mask(names, mask)) for mask in range(1 << len(names))]
            return self._play(worth, seed)
        except Exception as error:
            raise RunError(f"seed {seed}: {type(error).__name__}: {error}") from error

    def _play(self, worth: Callable[[Collection[str]], float], seed: int) -> tuple[list[float], Floats]:
        count = len(self.names)
        every = (1 << count) - 1

        def by_mask(mask: int) -> float:
            return worth(_of_mask(self.names, mask))

        single = [1 << k for k in range(count)]
        worths = [by_mask(mask) for mask in (0, every, *single, *(every ^ mask for mask in single))]
        if count <= EXACT:
            return worths, shapley_values([by_mask(mask) for mask in range(every + 1)])
        return worths, values_over_orders(by_mask, joining_orders(count, ORDERS, seed=seed))

    @cached_property
    def _trials(self) -> dict[int, MendedTrial]:
        return {}


def difference_interval(values: Floats, unit: str) -> Interval:
    """Return the mean of differences of a score, (n,), with its interval within what scores of this unit allow."""
    interval = mean_interval(values)
    scale = SCALES.get(unit, Scale())
    span = scale.high - scale.low
    return Interval(interval.mean, max(interval.low, -span), min(interval.high, span), interval.n)


def _of_mask(names: Sequence[str], mask: int) -> list[str]:
    return [name for k, name in enumerate(names) if mask >> k & 1]


def _mending(sets: Floats, sign: float, possible: Floats, names: Sequence[str], unit: str) -> Mending | None:
    """Return the fewest causes with :data:`RESTORED` of the possible gain.

    Args:
        sets: worth of every set of k causes, (seeds, 2^k).
        sign: -1 where a lower score is better.
        possible: gain with all causes mended, (seeds,).
        names: names of the k causes.
        unit: unit of the score.
    """
    gains = sign * (sets - sets[:, :1])
    whole, mean = float(possible.mean()), gains.mean(axis=0)
    if whole <= 0 or not np.isfinite(mean).all():
        return None
    mask = smallest_coalition(mean, RESTORED * whole)
    gain = difference_interval(gains[:, mask], unit)
    return Mending(tuple(_of_mask(names, mask)), mean_interval(sets[:, mask], unit=unit), gain, gain.mean / whole)
