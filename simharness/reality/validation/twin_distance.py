"""Distance of a recording from its twins over all figures at once, and whether twins are as far from each other.

Each figure is standardised by the twins: the recording is a draw of the same distribution if the twins are right, so
that its deviation has Student's t, which is turned into a normal deviate. The distance is the mean square of these
deviates, over groups of figures that measure the same, each of which counts once. What it is for right twins shows each
twin against the others. The logarithm of a mean of squares is nearly normal (Wilson and Hilferty), whatever the
correlations of the figures are, so that the p-value is that of one further draw: Student's t again. Twins that share a
fault of their model with no trace in the figures are not noticed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm, t

from mvpose.arrays import Floats
from simharness.reality.validation.evidence import Compared, number

NOTICED = 0.05
"""p-value below which twins count as distinguishable from the recording: the rate of false alarms."""

_LEAST_SPREAD = 0.5  # of a figure over twins, in standard errors of the recording's figure
_FEWEST = 4  # twins


@dataclass(frozen=True)
class TwinDistance:
    """Distance of a recording from its twins."""

    figures: int
    """Number of figures."""
    value: float
    """Mean over groups of the mean squared deviate of their figures; NaN with fewer than four twins."""
    usual: float
    """The same for each twin against the others, geometric mean."""
    p_value: float
    """Probability of such a distance if the recording were one more twin; NaN with fewer than four twins."""
    groups: Mapping[str, float]
    """Mean squared deviate of each group of figures that measure the same, the first word of their keys, largest
    first."""

    @property
    def noticed(self) -> bool:
        """Whether recording and twins differ by more than twins among themselves."""
        return self.p_value < NOTICED

    def summary(self) -> dict[str, Any]:
        """Return the numbers ready for JSON."""
        return {
            "figures": self.figures,
            "distance": number(self.value),
            "usual": number(self.usual),
            "p_value": number(self.p_value),
            "groups": {key: number(each) for key, each in self.groups.items()},
        }


def measure_distance(figures: Mapping[str, Compared]) -> TwinDistance:
    """Return the distance of a recording from its twins; figures that the recording or a twin lacks are left out.

    Args:
        figures: figures by key, whose first word is their group.
    """
    known = {
        key: each for key, each in figures.items() if np.isfinite([each.real.mean, *each.twins]).all() and each.twins
    }
    real = np.array([each.real.mean for each in known.values()])
    twins = np.array([each.twins for each in known.values()]).reshape(len(known), -1).T
    errors = [_standard_error(each.resamples) for each in known.values()]
    least = _LEAST_SPREAD * np.array(errors)
    nan = float("nan")
    if len(twins) < _FEWEST or not known:
        return TwinDistance(len(known), nan, nan, nan, {})
    names = np.array([key.partition(".")[0] for key in known])
    groups = np.array([(names == name) / (names == name).sum() for name in dict.fromkeys(names)])  # (G, K)
    means = groups @ _deviates(real, twins, least) ** 2
    value = float(means.mean())
    usual = [
        (groups @ _deviates(each, np.delete(twins, index, axis=0), least) ** 2).mean()
        for index, each in enumerate(twins)
    ]
    logs = np.log(np.maximum(usual, 1e-9))
    spread = max(float(logs.std(ddof=1)), 1e-9) * np.sqrt(1 + 1 / len(logs))
    chance = float(t.sf((np.log(max(value, 1e-9)) - logs.mean()) / spread, len(logs) - 1))
    order = sorted(zip(dict.fromkeys(names), means.tolist(), strict=True), key=lambda item: -item[1])
    return TwinDistance(len(known), value, float(np.exp(logs.mean())), chance, {str(key): each for key, each in order})


def _deviates(figures: Floats, others: Floats, least: Floats) -> Floats:
    """Return normal deviates of one recording's figures (K,) from those of n others, (n, K)."""
    count = len(others)
    spread = np.maximum(others.std(axis=0, ddof=1), least) * np.sqrt(1 + 1 / count)
    away = np.abs(figures - others.mean(axis=0))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(away > 0, away / spread, 0.0)
    return np.asarray(norm.isf(np.maximum(t.sf(ratio, count - 1), 1e-12)))


def _standard_error(resamples: Sequence[float] | Floats) -> float:
    known = np.asarray(resamples)[np.isfinite(resamples)]
    return float(known.std()) if len(known) > 1 else 0.0
