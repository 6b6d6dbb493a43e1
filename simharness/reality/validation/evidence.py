"""Figures of a recording beside those of its twins, with intervals."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm, rankdata

from mvpose.arrays import Floats
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.validation.passes import RecordingChange, ScoreSums, Tallies
from simharness.statistics.intervals import Interval, mean_interval
from simharness.statistics.resampling import block_weights, interval, resampled
from simharness.types.random_streams import stream

RESAMPLES = 500
"""Number of bootstrap resamples of a recording's frames."""

Sums = Mapping[RecordingChange, Mapping[str, ScoreSums]]
"""Tallies summed over frames, by change and variant: scalars, or one value for each of R resamples."""

Figure = Callable[[Sums], "Floats | float"]
"""Figure of a recording, from its sums; it is applied to all resamples at once."""

_OF_90 = float(norm.ppf(0.95) / norm.ppf(0.975))  # half-width of a 90 % interval over that of 95 %


@dataclass(frozen=True)
class Compared:
    """One figure of a recording and of its twins."""

    real: Interval
    """The recording's, with the interval of a block bootstrap over time."""
    twin: Interval
    """Mean over the twins, with the interval of a bootstrap over twins."""
    twins: tuple[float, ...] = ()
    """Figure of each twin."""
    resamples: Floats = field(default_factory=lambda: np.zeros(0))
    """Figure of each bootstrap resample of the recording, (R,)."""
    profile: float = float("nan")
    """Figure of a twin whose detector is the shipped profile; NaN without one."""

    @property
    def difference(self) -> float:
        """The twins' figure minus the recording's."""
        return self.twin.mean - self.real.mean

    @property
    def uncertainty(self) -> tuple[float, float]:
        """Distances of the ends of the 95 % interval of the difference from it, downwards and upwards.

        Each is the root of the squared half-widths of both intervals on the sides that face each other, because the two
        are independent. They are infinite where an interval is unknown.
        """
        real, twin = self.real, self.twin
        down = np.hypot(twin.mean - twin.low, real.high - real.mean)
        up = np.hypot(twin.high - twin.mean, real.mean - real.low)
        return tuple(float(each) if np.isfinite(each) else float("inf") for each in (down, up))  # type: ignore[return-value]

    @property
    def tested(self) -> tuple[float, float]:
        """Ends of the 90 % interval of the difference, for two one-sided tests at 5 %.

        The half-widths are those of 95 % in the ratio of the normal distribution; that of Student's t is a little
        smaller, so that the tests are conservative.
        """
        down, up = self.uncertainty
        return self.difference - _OF_90 * down, self.difference + _OF_90 * up

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


class Ratio(NamedTuple):
    """Ratio of two sums over frames, from the contribution of each frame, both (F,)."""

    numerator: Floats
    denominator: Floats

    @property
    def value(self) -> float:
        """The ratio; NaN where the denominator is 0."""
        total = self.denominator.sum()
        return float(self.numerator.sum() / total) if total else float("nan")

    def resampled(self, weights: Floats) -> Floats:
        """Return the ratio in R resamples of the frames, (R,), from their weights (R, F)."""
        numerator, denominator = resampled(self.numerator, weights), resampled(self.denominator, weights)
        return np.where(denominator > 0, numerator / np.where(denominator > 0, denominator, 1.0), np.nan)


def by_frame(counted: NDArray[Any]) -> Floats:
    """Return the sums over all axes but the first, (F,)."""
    return counted.reshape(len(counted), -1).sum(axis=1, dtype=float)


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
    profile: Sums | None = None
    """Sums of a twin whose detector is the shipped profile."""

    @classmethod
    def of_tallies(
        cls,
        recording: AnnotatedRecording,
        real: Mapping[RecordingChange, Tallies],
        twins: Sequence[Mapping[RecordingChange, Tallies]],
        profile: Mapping[RecordingChange, Tallies] | None = None,
    ) -> "Evidence":
        """Return the evidence from tallies of frames.

        Args:
            recording: the recording, with the frames of its tallies.
            real: tallies of its frames by change.
            twins: tallies of the frames of each twin, by change.
            profile: tallies of a twin whose detector is the shipped profile.
        """
        weights = frame_weights(recording)
        return cls(
            _each(real, ScoreSums.total),
            _each(real, lambda tally: tally.resampled(weights)),
            tuple(_each(twin, ScoreSums.total) for twin in twins),
            None if profile is None else _each(profile, ScoreSums.total),
        )

    def compare(self, figure: Figure) -> Compared:
        """Return a figure of the recording beside that of its twins."""
        return compared(
            float(figure(self.real)),
            figure(self.resamples),
            [float(figure(twin)) for twin in self.twins],
            profile=float("nan") if self.profile is None else float(figure(self.profile)),
        )


def compared(
    real: float, resamples: Floats | float, twins: Sequence[float], *, profile: float = float("nan")
) -> Compared:
    """Return a figure of a recording, with that of its R resamples (R,), beside the figures of its twins.

    Args:
        real: the recording's figure.
        resamples: figures of the resamples, (R,).
        twins: figure of each twin.
        profile: figure of a twin whose detector is the shipped profile.
    """
    drawn = np.atleast_1d(np.asarray(resamples, float))
    low, high = interval(drawn)
    return Compared(Interval(real, float(low), float(high), 1), mean_interval(twins), tuple(twins), drawn, profile)


def twin_means(twins: ArrayLike, *, resamples: int = RESAMPLES) -> Floats:
    """Return the means of figures over bootstrap resamples of T twins, (R, ...), from those of the twins, (T, ...).

    They are spread by T / (T - 1) in variance, which resamples of few twins lack.
    """
    values = np.asarray(twins, float)
    count = len(values)
    drawn = stream(0, "validation", "twins").integers(count, size=(resamples, count))
    weights = np.stack([(drawn == k).mean(axis=1) for k in range(count)], axis=1)
    mean = values.mean(axis=0)
    spread = np.sqrt(count / (count - 1)) if count > 1 else 1.0
    return np.asarray(mean + spread * np.tensordot(weights, values - mean, axes=1))


def frame_weights(recording: AnnotatedRecording) -> Floats:
    """Return the weights of the frames in bootstrap resamples, (R, F), by blocks of one second."""
    step = float(np.median(np.diff(recording.frames))) if len(recording) > 1 else 1.0
    return block_weights(np.arange(len(recording)) * step / recording.rate, resamples=RESAMPLES)


def rank_correlation(real: ArrayLike, twins: ArrayLike, *, resamples: Floats | None = None) -> Interval:
    """Return Spearman's correlation of two lists of n numbers; NaN with fewer than three, or where one is constant.

    Args:
        real: numbers of the recording, (n,).
        twins: numbers of T twins, (T, n), or their means, (n,). Places with a NaN are left out.
        resamples: numbers of R bootstrap resamples of the recording, (R, n), for the interval, which also has bootstrap
            resamples of the twins; None: no interval.
    """
    each = np.atleast_2d(np.asarray(twins, float))
    value = _spearman(np.asarray(real, float), each.mean(axis=0))
    if resamples is None or not np.isfinite(value):
        return Interval(value, np.nan, np.nan, 1)
    drawn = twin_means(each, resamples=len(resamples))
    low, high = interval([_spearman(*pair) for pair in zip(resamples, drawn, strict=True)])
    return Interval(value, float(low), float(high), 1)


def ranked(figures: Sequence[Compared]) -> Interval:
    """Return Spearman's correlation of figures of the recording and of the twins; NaN for fewer than three."""
    if not figures:
        return Interval(np.nan, np.nan, np.nan, 0)
    return rank_correlation(
        [each.real.mean for each in figures],
        np.stack([each.twins for each in figures], axis=-1),
        resamples=np.stack([each.resamples for each in figures], axis=-1),
    )


def number(value: float) -> float | None:
    """Return the value for JSON, None where it is not finite."""
    return float(value) if np.isfinite(value) else None


def plain(value: Interval) -> dict[str, Any]:
    """Return a value with its interval for JSON; unknown numbers are null."""
    return {"value": number(value.mean), "interval": [number(value.low), number(value.high)]}


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
