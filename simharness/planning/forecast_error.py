"""Errors of forecasts: by how much the figures of rigs that nobody has recorded turn out to be different.

Scenes of the simulator differ by their people and draws; that is the noise of a forecast, which more scenes make small.
What a forecast does not know stays: the network that will be used, how people stand and move, how exact the calibration
is, and how the truth is annotated. These errors are measured where both are known: forecasts that know no more than the
rig, where people are and their number, beside a network on rendered pictures of ten rigs, and beside the recording
Shelf (``python -m benchmarks.planning.blind_forecasts``). A profile of that network, measured in other pictures, leaves
a third of them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from simharness.scenario.sections.detector_section import DetectorSection
from simharness.statistics.intervals import LEVEL as SCENES
from simharness.statistics.intervals import Interval

LEVEL = 0.9
"""Coverage probability of the intervals of forecasts."""


@dataclass(frozen=True)
class ForecastError:
    """Error of a kind of figure, normally distributed about the forecast."""

    least: float
    """Standard deviation for figures of size 0, in the unit of the figure."""
    share: float
    """Standard deviation as a share of the size, for large ones."""
    rigs: int
    """Number of rigs on which it was measured: the quantile is that of Student's t."""

    @property
    def quantile(self) -> float:
        """Half the width of an interval in standard deviations."""
        return float(t.ppf((1 + LEVEL) / 2, self.rigs - 1))

    def deviation(self, size: float) -> float:
        """Return the standard deviation for a figure of some size."""
        return float(np.hypot(self.least, self.share * size))

    def interval(self, scenes: Interval, size: float, *, low: float = -np.inf, high: float = np.inf) -> Interval:
        """Return the interval of a forecast.

        Args:
            scenes: mean over scenes, with the interval of their noise.
            size: size of the figure, which is 0 where nothing can be wrong: points lost, millimetres.
            low: least possible value.
            high: greatest possible value.
        """
        if not np.isfinite(scenes.mean):
            return scenes
        model = self.quantile * self.deviation(size)
        noise = norm.ppf((1 + LEVEL) / 2) / norm.ppf((1 + SCENES) / 2)
        down, up = (
            np.hypot(model, noise * width if np.isfinite(width) else 0.0)
            for width in (scenes.mean - scenes.low, scenes.high - scenes.mean)
        )
        ends = max(scenes.mean - down, low), min(scenes.mean + up, high)
        return Interval(scenes.mean, float(ends[0]), float(ends[1]), scenes.n)


@dataclass(frozen=True)
class ForecastErrors:
    """Errors of the forecasts with a kind of detector profile."""

    pcp: ForecastError
    """Of PCP, points; its size are the points below 100."""
    loss: ForecastError
    """Of PCP lost or gained by a camera or a fault, points."""
    mpjpe: ForecastError
    """Of joint errors, mm."""

    @classmethod
    def of_detector(cls, detector: DetectorSection) -> "ForecastErrors":
        """Return those of a profile: whether it was measured on the network that will be used, or is a general one."""
        return MEASURED if detector.measured else GENERAL

    def of_pcp(self, scenes: Interval) -> Interval:
        """Return the interval of a forecast of PCP, or of recall, percent, given that over scenes."""
        return self.pcp.interval(scenes, 100.0 - scenes.mean, low=0.0, high=100.0)

    def of_loss(self, scenes: Interval) -> Interval:
        """Return the interval of a forecast of a difference of PCP, points."""
        return self.loss.interval(scenes, abs(scenes.mean))

    def of_mm(self, scenes: Interval) -> Interval:
        """Return the interval of a forecast of joint errors, mm."""
        return self.mpjpe.interval(scenes, scenes.mean, low=0.0)


# Fitted least errors below 0.2 points and 1 mm are taken as these: no forecast is exact.
GENERAL = ForecastErrors(ForecastError(4.2, 0.37, 11), ForecastError(0.8, 0.4, 11), ForecastError(1.0, 0.45, 11))
"""Errors with a shipped profile of no certain network."""

MEASURED = ForecastErrors(ForecastError(0.6, 0.28, 9), ForecastError(0.2, 0.43, 9), ForecastError(1.9, 0.13, 9))
"""Errors with a profile that was measured on other pictures of the network (``python -m tools.network_profile``)."""


def forecast_text(forecast: Interval, *, digits: int = 1) -> str:
    """Return a figure and its interval as text: "96.4 (94.0 to 98.1)"; alone where it has none."""
    mean, ends = forecast.texts(digits)
    return f"{mean} ({ends})" if ends else mean
