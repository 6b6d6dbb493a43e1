"""Figures of a recording beside those of its twins, with intervals."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

from mvpose.arrays import Floats
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.validation.passes import RecordingChange, ScoreSums, Tallies
from simharness.statistics.intervals import Interval, mean_interval
from simharness.statistics.resampling import block_weights, interval

RESAMPLES = 500
"""Number of bootstrap resamples of a recording's frames."""

Sums = Mapping[RecordingChange, Mapping[str, ScoreSums]]
"""Tallies summed over frames, by change and variant: scalars, or one value for each of R resamples."""

Figure = Callable[[Sums], "Floats | float"]
"""Figure of a recording, from its sums; it is applied to all resamples at once."""


@dataclass(frozen=True)
class Compared:
    """One figure of a recording and of its twins."""

    real: Interval
    """The recording's, with the interval of a block bootstrap over time."""
    twin: Interval
    """Mean over the twins, with the interval of a bootstrap over twins."""
    twins: tuple[float, ...] = ()
    """Figure of each twin."""

    @property
    def difference(self) -> float:
        """The twins' figure minus the recording's."""
        return self.twin.mean - self.real.mean

    @property
    def uncertainty(self) -> tuple[float, float]:
        """Distances of the ends of the 95 % interval of the difference from it, downwards and upwards.

        Each is the root of the squared half-widths of both intervals on the sides that face each other, because the two
        are independent. An unknown interval counts as a point.
        """
        real, twin = self.real, self.twin
        down = np.hypot(_width(twin.mean - twin.low), _width(real.high - real.mean))
        up = np.hypot(_width(twin.high - twin.mean), _width(real.mean - real.low))
        return float(down), float(up)

    def summary(self) -> dict[str, Any]:
        """Return the numbers ready for JSON; unknown ones are null."""
        down, up = self.uncertainty
        return {
            "real": number(self.real.mean),
            "twin": number(self.twin.mean),
            "difference": number(self.difference),
            "real_interval": [number(self.real.low), number(self.real.high)],
            "twin_interval": [number(self.twin.low), number(self.twin.high)],
            "difference_interval": [number(self.difference - down), number(self.difference + up)],
        }


@dataclass(frozen=True)
class Evidence:
    """Sums of a recording, of its resamples and of its twins."""

    real: Sums
    """Sums of the recording."""
    resamples: Sums
    """Sums of R bootstrap resamples of its frames; the same resamples for all changes and variants, so that differences
    between them are paired."""
    twins: tuple[Sums, ...]
    """Sums of each twin."""

    @classmethod
    def of_tallies(
        cls,
        recording: AnnotatedRecording,
        real: Mapping[RecordingChange, Tallies],
        twins: Sequence[Mapping[RecordingChange, Tallies]],
    ) -> "Evidence":
        """Return the evidence from tallies of frames.

        Args:
            recording: the recording, with the frames of its tallies.
            real: tallies of its frames by change.
            twins: tallies of the frames of each twin, by change.
        """
        weights = frame_weights(recording)
        return cls(
            _each(real, ScoreSums.total),
            _each(real, lambda tally: tally.resampled(weights)),
            tuple(_each(twin, ScoreSums.total) for twin in twins),
        )

    def compare(self, figure: Figure) -> Compared:
        """Return a figure of the recording beside that of its twins."""
        return compared(float(figure(self.real)), figure(self.resamples), [float(figure(twin)) for twin in self.twins])


def compared(real: float, resamples: Floats | float, twins: Sequence[float]) -> Compared:
    """Return a figure of a recording, with that of its R resamples (R,), beside the figures of its twins."""
    low, high = interval(np.atleast_1d(np.asarray(resamples, float)))
    return Compared(Interval(real, float(low), float(high), 1), mean_interval(twins), tuple(twins))


def frame_weights(recording: AnnotatedRecording) -> Floats:
    """Return the weights of the frames in bootstrap resamples, (R, F), by blocks of one second."""
    step = float(np.median(np.diff(recording.frames))) if len(recording) > 1 else 1.0
    return block_weights(np.arange(len(recording)) * step / recording.rate, resamples=RESAMPLES)


def rank_correlation(real: ArrayLike, twin: ArrayLike, *, resamples: Floats | None = None) -> Interval:
    """Return Spearman's correlation of two lists of n numbers; NaN with fewer than three, or where one is constant.

    Args:
        real: numbers of the recording, (n,).
        twin: numbers of the twins, (n,). Places with a NaN in either are left out.
        resamples: numbers of R bootstrap resamples of the recording, (R, n), for the interval; None: no interval.
    """
    value = _spearman(np.asarray(real, float), np.asarray(twin, float))
    if resamples is None or not np.isfinite(value):
        return Interval(value, np.nan, np.nan, 1)
    low, high = interval([_spearman(each, np.asarray(twin, float)) for each in resamples])
    return Interval(value, float(low), float(high), 1)


def number(value: float) -> float | None:
    """Return the value for JSON, None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def _spearman(one: Floats, other: Floats) -> float:
    known = np.isfinite(one) & np.isfinite(other)
    if known.sum() < 3:
        return float("nan")
    ranks = rankdata(one[known]), rankdata(other[known])
    if any(np.ptp(each) == 0 for each in ranks):
        return float("nan")
    return float(np.corrcoef(*ranks)[0, 1])


def _each(
    tallies: Mapping[RecordingChange, Tallies], function: Callable[[ScoreSums], ScoreSums]
) -> dict[RecordingChange, dict[str, ScoreSums]]:
    return {change: {name: function(each) for name, each in of.items()} for change, of in tallies.items()}


def _width(value: float) -> float:
    return value if np.isfinite(value) else 0.0
