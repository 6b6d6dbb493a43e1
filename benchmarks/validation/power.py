"""Power of a validation, and its rate of false alarms.

Twins of a recording are simulated with the fitted detector (right twins), and with one thing wrong. Both predict the
recording, and other right twins in its place, of which it is known that nothing else is wrong. Wrong twins are noticed

- on the recording, if it is farther from them than from right twins: a permutation of right and wrong twins says how
  probable the ratio of both distances is among right twins;
- on twins in the place of the recording, if these differ noticeably from them
  (:mod:`simharness.reality.validation.twin_distance`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.validation.wrong_twins import WrongTwin
from mvpose.commands.progress import Reporter
from simharness.reality.annotated_recording import AnnotatedRecording
from simharness.reality.twin import TwinModel, detected_twin
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.passes import VARIANTS, annotated
from simharness.reality.validation.twin_distance import NOTICED, TwinDistance, measure_distance
from simharness.reality.validation.verdicts import BOUNDS, BoundVerdict, VerdictState
from simharness.reality.validation.whole_comparison import MeasuredRecording, compare_whole, measure_recordings
from simharness.statistics.intervals import Interval

_PERMUTATIONS = 199


@dataclass(frozen=True)
class Noticed:
    """What a validation says of some twins."""

    fails: int
    """Number of verdicts on the recording that fail."""
    holds: int
    """Number that hold."""
    lost: int
    """Number that hold for right twins, but not for these."""
    ratio: float
    """Distance of the recording from these twins over that from right ones."""
    p_value: float
    """Probability of such a ratio among right twins."""
    swapped: Sequence[float]
    """p-values of the twins in the place of the recording."""

    @property
    def share(self) -> float:
        """Share of the twins in the place of the recording that differ noticeably from these."""
        return float(np.mean(np.array(self.swapped) < NOTICED))


@dataclass(frozen=True)
class Power:
    """A recording, right twins, and further right twins in the place of the recording."""

    real: MeasuredRecording
    right: Sequence[MeasuredRecording]
    others: Sequence[MeasuredRecording]

    def noticed(self, twins: Sequence[MeasuredRecording]) -> Noticed:
        """Return what a validation says of as many twins as there are right ones."""
        held = {each.name for each in self._verdicts(self.right) if each.state == VerdictState.HOLDS}
        verdicts = self._verdicts(twins)
        states = [each.state for each in verdicts]
        count = len(self.right)
        figures = compare_whole(self.real, [*self.right, *twins, *self.others]).figures
        rng, observed = np.random.default_rng(0), _ratio(figures, np.arange(2 * count))
        drawn = [_ratio(figures, rng.permutation(2 * count)) for _ in range(_PERMUTATIONS)]
        wrong = range(count, 2 * count)
        swapped = [
            distance_from(figures, wrong, recording=2 * count + index).p_value for index in range(len(self.others))
        ]
        return Noticed(
            fails=states.count(VerdictState.FAILS),
            holds=states.count(VerdictState.HOLDS),
            lost=sum(each.name in held and each.state != VerdictState.HOLDS for each in verdicts),
            ratio=observed,
            p_value=(1 + sum(each >= observed for each in drawn)) / (1 + len(drawn)),
            swapped=swapped,
        )

    def _verdicts(self, twins: Sequence[MeasuredRecording]) -> list[BoundVerdict]:
        return compare_whole(self.real, twins).verdicts(self.real.recording.kind, BOUNDS)


def distance_from(figures: Mapping[str, Compared], twins: Sequence[int], *, recording: int = -1) -> TwinDistance:
    """Return the distance from some of the twins, of the recording or of another twin in its place (an index)."""
    chosen = {}
    for key, each in figures.items():
        real = each.real if recording < 0 else Interval(each.twins[recording], np.nan, np.nan, 1)
        chosen[key] = replace(each, real=real, twins=tuple(each.twins[index] for index in twins))
    return measure_distance(chosen)


def _ratio(figures: Mapping[str, Compared], order: np.ndarray) -> float:
    """Return the distance of the recording from the second half of some twins, over that from the first."""
    first, second = np.split(order, 2)
    return distance_from(figures, second.tolist()).value / distance_from(figures, first.tolist()).value


def simulated(
    model: TwinModel,
    wrong: WrongTwin,
    seeds: Sequence[int],
    *,
    every: int = 1,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> list[MeasuredRecording]:
    """Simulate twins and measure every n-th of their frames.

    Args:
        model: what right twins are made from, with all of its films.
        wrong: what is wrong.
        seeds: seeds of the twins.
        every: n.
        workers: number of processes.
        reporter: receiver of progress.
    """
    changed = wrong.model(model)
    twins = (detected_twin(changed, changed.films[seed % len(changed.films)], seed=seed) for seed in seeds)
    return measured(
        [wrong.recording(twin, seed) for twin, seed in zip(twins, seeds, strict=True)],
        every=every,
        workers=workers,
        reporter=reporter,
    )


def measured(
    recordings: Sequence[AnnotatedRecording], *, every: int, workers: int = 1, reporter: Reporter | None = None
) -> list[MeasuredRecording]:
    """Score all variants on every n-th frame of recordings, and measure the detections."""
    chosen = [annotated(each, every=every) for each in recordings]
    return measure_recordings(chosen, variants=VARIANTS, workers=workers, reporter=reporter)
