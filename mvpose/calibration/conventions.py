"""Hypotheses about wrong files: which reading of calibration and detections makes the cameras agree.

A hypothesis says how the files would have to be read if one mistake had been made, in one camera or in all. All are
compared by the same evidence (:mod:`.consistency`) on the same detections, "nothing is wrong" among them. The best one
is applied, and the search goes on with it, so that several cameras may have mistakes of their own.

The findings name the mistakes and how to mend the files.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.file_mistakes import CHANGES, SWAPPED, Mistake
from mvpose.calibration.findings import Finding
from mvpose.calibration.mends import Mend
from mvpose.calibration.picture_offsets import EXPLAINED, OffsetSearch
from mvpose.calibration.reading_changes import Size, changed

_TEMPER = 0.05
"""Share of the keypoints that count as independent: errors last for about half a second (two or three of the frames
that are compared), and joints of one person err together (17 joints as about four), as do pairs of views."""

_CERTAIN = 0.95  # posterior probability from which a mistake is named
_AGREES = 0.5  # a mended camera must agree with the others at least this well, compared with the others among them
_GAIN = 0.02  # least gain, as a share of all evidence: less is a matter of small errors, not of conventions
_LEAST_ODDS = 3.0  # log likelihood ratio by which a mistake explains more than cameras that are off by degrees
_OFF = (float(np.radians(1.5)), 0.10)
"""Standard deviations of rotations (rad) and places (m) of cameras that were touched."""

_PLAUSIBLE = 4.0  # mean squared move in these, up to which moved cameras are believed without a search for crops
_LARGEST_TURN = float(np.radians(5.0))  # a crop of 6 % of a picture with a field of view of 75 degrees is such a turn
_LEAST_AGREEMENT = 0.2  # people who are not the same agree less, by chance
_NOTHING = 0.8  # prior probability that the files are right


@dataclass(frozen=True)
class FoundMistake:
    """A mistake found."""

    mistake: Mistake
    """The mistake and its views."""
    probability: float
    """Posterior probability among all hypotheses."""
    gain: float
    """Log likelihood ratio to the reading without it, tempered."""
    whole: bool
    """Whether it concerns all cameras."""


def search(
    consistency: Consistency, given: Reading, offsets: OffsetSearch, corrected: Callable[[Reading], Reading]
) -> tuple[Reading, list[FoundMistake]]:
    """Return the reading under which the cameras agree best, and the mistakes that lead to it, in the order found.

    Args:
        consistency: evidence for readings of the detections.
        given: the files as they are.
        offsets: search of crops and turns.
        corrected: returns the reading with the poses of its cameras corrected by matching people over seconds.
    """
    reading, verdicts = given, []
    for _ in range(len(offsets.sizes) + 1):
        step = _best(consistency, reading, offsets, corrected)
        if step is None:
            break
        reading, verdict = step
        verdicts.append(verdict)
    return reading, verdicts


def hypotheses(reading: Reading, sizes: Sequence[Size]) -> Iterator[tuple[Mistake, Reading]]:
    """Yield each mistake with the reading that undoes it, without crops.

    Args:
        reading: the reading so far.
        sizes: width and height of the pictures, pixels.
    """
    views = len(sizes)
    everyone = tuple(range(views))
    for mistake, change in CHANGES:
        sets = [(view,) for view in everyone] if views > 2 else []
        for chosen in [*sets, everyone] if mistake.of_all else sets:
            other = changed(reading, sizes, change, chosen)
            if other is not None:
                yield replace(mistake, views=chosen), other
    if views > 2:
        for i in range(views):
            for j in range(i):
                cameras = reading.cameras.copy()
                cameras[[i, j]] = cameras[[j, i]]
                yield replace(SWAPPED, views=(j, i)), replace(reading, cameras=cameras)


def _best(
    consistency: Consistency, reading: Reading, offsets: OffsetSearch, corrected: Callable[[Reading], Reading]
) -> tuple[Reading, FoundMistake] | None:
    """Return the reading without the likeliest mistake, and the mistake; None if none is certain.

    A mistake is named only if it explains clearly more than corrections of the poses do. Crops and turns are searched
    only for cameras that agree badly, and where nothing else explains it.
    """
    best = _likeliest(consistency, reading, hypotheses(reading, offsets.sizes))
    if best is None and _explained(consistency, reading):
        return None
    now = _Moved.corrected(consistency, reading, corrected)
    then = None if best is None else _Moved.corrected(consistency, best[0], corrected)
    if then is not None and not then.explains_more_than(now):
        best, then = None, None
    latest = then or now
    if latest.small and _explained(consistency, latest.reading):
        return best
    other = _likeliest(consistency, reading, offsets.candidates(reading))
    if other is None or not _Moved.corrected(consistency, other[0], corrected).explains_more_than(latest):
        return best
    return other


@dataclass(frozen=True)
class _Moved:
    """A reading with corrected poses of its cameras."""

    reading: Reading
    """The reading with corrected cameras."""
    evidence: float
    """Log likelihood ratio of one world to chance."""
    unlikely: float
    """Half the squared sizes of all moves in standard deviations (:data:`_OFF`)."""
    largest: float
    """Largest turn, radians."""

    @classmethod
    def corrected(cls, consistency: Consistency, reading: Reading, correction: Callable[[Reading], Reading]) -> Self:
        """Return a reading with corrected cameras."""
        moved = correction(reading)
        before, after = reading.cameras, moved.cameras
        turns = after[:, 5:14].reshape(-1, 3, 3) @ before[:, 5:14].reshape(-1, 3, 3).swapaxes(1, 2)
        angles = Rotation.from_matrix(turns).magnitude()
        shifts = np.linalg.norm(after[:, 14:17] - before[:, 14:17], axis=1)
        unlikely = 0.5 * float(((angles / _OFF[0]) ** 2 + (shifts / _OFF[1]) ** 2).sum())
        return cls(moved, float(consistency(moved).sum()), unlikely, float(angles.max()))

    @property
    def small(self) -> bool:
        """Whether the corrections are plausible for cameras that were measured by eye, and smaller than for a crop."""
        return self.unlikely < _PLAUSIBLE * 3.0 * len(self.reading.cameras) and self.largest < _LARGEST_TURN

    def explains_more_than(self, other: Self) -> bool:
        """Whether it is clearly likelier than another reading, moves of the cameras included."""
        gain = _TEMPER * (self.evidence - other.evidence) - (self.unlikely - other.unlikely)
        return gain > _LEAST_ODDS


def _explained(consistency: Consistency, reading: Reading) -> bool:
    """Whether all cameras agree about as well as the errors of keypoints allow."""
    agrees = consistency.agreement(reading)
    return bool(agrees.min() >= EXPLAINED * np.median(agrees) and np.median(agrees) >= EXPLAINED)


def _likeliest(
    consistency: Consistency, reading: Reading, candidates: Iterator[tuple[Mistake, Reading]]
) -> tuple[Reading, FoundMistake] | None:
    now = consistency(reading).sum()
    mistakes, readings, scores = [], [], []
    for mistake, other in candidates:
        mistakes.append(mistake)
        readings.append(other)
        scores.append(consistency(other).sum())
    if not mistakes:
        return None
    gains = _TEMPER * (np.array(scores) - now)
    prior = np.log([each.prior for each in mistakes]) - np.log(sum(each.prior for each in mistakes))
    posterior = gains + prior + np.log1p(-_NOTHING)
    best = int(np.argmax(posterior))
    named = mistakes[best]
    same = [
        k
        for k, each in enumerate(mistakes)
        if (each.kind == named.kind and each.views == named.views) or _alike(readings[k], readings[best])
    ]
    probability = float(np.exp(logsumexp(posterior[same]) - logsumexp([*posterior, np.log(_NOTHING)])))
    if probability < _CERTAIN or scores[best] - now < _GAIN * scores[best]:
        return None
    after, views = consistency.agreement(readings[best]), list(named.views)
    rest = np.delete(after, views)
    wanted = max(_AGREES * float(np.median(rest)) if len(rest) > 1 else 0.0, _LEAST_AGREEMENT)
    if np.mean(after[views]) < wanted:
        return None
    return readings[best], FoundMistake(named, probability, float(gains[best]), len(views) == len(after))


def _alike(one: Reading, other: Reading) -> bool:
    """Whether two readings are the same."""
    return (
        np.allclose(one.cameras, other.cameras)
        and np.allclose(one.pixels, other.pixels)
        and np.array_equal(one.exchanged, other.exchanged)
    )


def mistake_finding(verdict: FoundMistake, names: Sequence[str]) -> Finding:
    """Return the finding of a mistake in the files."""
    mistake = verdict.mistake
    named = [names[view] for view in mistake.views]
    everyone = verdict.whole and len(mistake.views) == len(names)
    who = "all cameras" if everyone else " and ".join(named)
    possible = bool(mistake.mend) and (everyone or mistake.mend != "mirrored")
    name, _, values = mistake.mend.partition(":")
    mend = Mend(name, values, () if everyone else tuple(named)) if possible else None
    camera, view = (None, None) if everyone else (named[0], mistake.views[0])
    text, advice = (each.replace("{who}", who) for each in (mistake.text, mistake.advice))
    repair, cost = () if mend is None else ("--mend", str(mend)), verdict.probability * len(mistake.views) / len(names)
    probability, size = min(verdict.probability, 1.0), dict(mistake.size)
    return Finding(mistake.kind, text, "alarm", probability, camera, view, size, {}, cost, advice, repair)
