"""Means of scores over scenes with confidence intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator
from scipy.special import gammainccinv, gammaincinv

from mvpose.arrays import Floats
from simharness.runtime.number_text import NOTHING, fixed, span
from simharness.statistics.studentized import mean_ends

LEVEL = 0.95
"""Coverage probability of all intervals."""

RARE = 5
"""Largest number of scenes with an event for which events are rare, if other scenes have none."""


_Number = Annotated[float, BeforeValidator(lambda value: np.nan if value is None else value)]  # NaN is null in JSON


@dataclass(frozen=True)
class Interval:
    """Mean over scenes with its 95 % confidence interval.

    Attributes:
        mean: mean over the scenes; NaN without scenes.
        low, high: ends of the interval; NaN with fewer than two scenes.
        n: number of scenes to which the score applies.
    """

    mean: _Number
    low: _Number
    high: _Number
    n: int

    def texts(self, digits: int, factor: float = 1.0) -> tuple[str, str]:
        """Return the mean times ``factor`` with so many decimals, and the ends, as text: "96.4", "94.0 to 98.1"."""
        if not np.isfinite(self.mean):
            return NOTHING, ""
        return fixed(factor * self.mean, digits), span(factor * self.low, factor * self.high, digits)

    def to_json(self) -> dict[str, float]:
        """Return mean, ends and number of scenes by their names in JSON."""
        return {"mean": self.mean, "low": self.low, "high": self.high, "scenes": self.n}


@dataclass(frozen=True)
class Scale:
    """Possible values of a score of one scene.

    Attributes:
        low, high: bounds.
        event: distance from a bound that one event makes in a scene if it lasts for the whole scene; None for a score
            that does not count events. It limits the mean where no scene has an event.
    """

    low: float = -np.inf
    high: float = np.inf
    event: float | None = None


SCALES: Mapping[str, Scale] = MappingProxyType(
    {
        "per frame": Scale(low=0.0, event=1.0),
        "/min": Scale(low=0.0, event=1.0),
        "%": Scale(low=0.0, high=100.0, event=25.0),
        "mm": Scale(low=0.0),
        "mm/s": Scale(low=0.0),
        "px": Scale(low=0.0),
        "ms": Scale(low=0.0),
    }
)
"""Scales by unit; scores of other units have no bounds.

The event of rates is one ghost in every frame of one scene, as a coat on a stand makes it; that of percentages is one
person of four, the default number of people; that of switches a minute and person is one switch of four people in a
quarter of a minute.
"""


def mean_interval(values: Sequence[float | None] | ArrayLike, *, unit: str = "") -> Interval:
    """Return the mean of a score (n,) over scenes with its 95 % interval.

    The interval is that of Student's t corrected for skewness (:mod:`simharness.statistics.studentized`), within the
    bounds of the score. Scores that most scenes have at a bound, such as ghosts of 0 or a recall of 100 %, say little
    about the rare scenes that decide the mean. With at most :data:`RARE` such scenes the end at the bound
    is that of rare events, and the other one is where that of rare events or of t is, whichever is farther: a gamma
    interval for sums of weighted Poisson counts (Fay & Feuer, Statistics in Medicine 1997; for single events it is that
    of Garwood, Biometrika 1936), in which the events of a scene are one event of that weight, because they come
    together. Where all scenes are at the bound, the weight is the event of :data:`SCALES`.

    Args:
        values: score of each scene.
        unit: unit of the score, for its bounds and events.
    """
    values = scene_scores(values)
    values = values[np.isfinite(values)]
    n = len(values)
    if not n:
        return Interval(np.nan, np.nan, np.nan, 0)
    mean = float(values.mean())
    if n < 2:
        return Interval(mean, np.nan, np.nan, n)
    scale = SCALES.get(unit, Scale())
    low, high = (float(end) for end in mean_ends(values, level=LEVEL))
    if scale.event is not None:
        # Events count from the nearer bound: missed people from 100 % of recall.
        mirrored = scale.high - mean < mean - scale.low
        events = scale.high - values if mirrored else values - scale.low
        if (rare := _rare_ends(events, scale.event)) is not None:
            few, many = rare
            low, high = (min(low, scale.high - many), scale.high - few) if mirrored else (few, max(high, many))
    return Interval(mean, min(max(low, scale.low), mean), max(min(high, scale.high), mean), n)


def scene_scores(values: Sequence[float | None] | ArrayLike) -> Floats:
    """Return the scores of scenes as floats, (n,), NaN for None.

    Raises:
        ValueError: not one-dimensional.
    """
    scores = np.array(values, float)
    if scores.ndim != 1:
        raise ValueError(f"scores must be (n,), one for each scene, got shape {scores.shape}")
    return scores


def _rare_ends(events: Floats, event: float) -> tuple[float, float] | None:
    """Return the ends of the interval of the mean of rare events (n,); None where they are not rare.

    The upper end allows for one more event, of the largest weight (Fay & Feuer) times 1 + 3 / k, because the largest of
    k weights is not the largest possible one. This also covers that the variance comes from few scenes.
    """
    n = len(events)
    hit = int((events > 1e-9 * event).sum())
    if hit > RARE or hit == n:
        return None
    tail = (1 - LEVEL) / 2
    mean, variance = (float(events.mean()), float(events.var(ddof=1)) / n) if hit else (0.0, 0.0)
    weight = float(events.max()) * (1 + 3 / hit) / n if hit else event / n
    low = variance / mean * float(gammaincinv(mean**2 / variance, tail)) if hit else 0.0
    mean, variance = mean + weight, variance + weight**2
    return low, variance / mean * float(gammainccinv(mean**2 / variance, tail))
