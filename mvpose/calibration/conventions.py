"""Hypotheses about wrong files: which reading of calibration and detections makes the cameras agree.

A hypothesis says how the files would have to be read if one mistake had been made, in one camera or in all. All are
compared by the same evidence (:mod:`.consistency`) on the same detections, "nothing is wrong" among them. The best one
is applied, and the search goes on with it, so that several cameras may have mistakes of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from mvpose.arrays import Floats
from mvpose.calibration.consistency import Consistency, Reading
from mvpose.calibration.file_mistakes import CHANGES, SWAPPED, Mistake
from mvpose.calibration.picture_offsets import EXPLAINED, offset_pictures
from mvpose.calibration.reading_changes import Size, changed

_TEMPER = 0.05
"""Share of the keypoints that count as independent: errors last for about half a second (two or three of the frames
that are compared), and joints of one person err together (17 joints as about four), as do pairs of views."""

_CERTAIN = 0.95  # posterior probability from which a mistake is named
_AGREES = 0.5  # a mended camera must agree with the others at least this well, compared with the others among them
_GAIN = 0.02  # least gain, as a share of all evidence: less is a question of millimetres, not of conventions
_LEAST_AGREEMENT = 0.2  # people who are not the same agree less, by chance
_NOTHING = 0.8  # prior probability that the files are right


@dataclass(frozen=True)
class Verdict:
    """A mistake found.

    Attributes:
        mistake: the mistake and its views.
        probability: posterior probability among all hypotheses.
        gain: log likelihood ratio to the reading without it, tempered.
        whole: whether it concerns all cameras.
    """

    mistake: Mistake
    probability: float
    gain: float
    whole: bool


def search(consistency: Consistency, given: Reading, sizes: Sequence[Size]) -> tuple[Reading, list[Verdict], Floats]:
    """Return the reading under which the cameras agree best, and the mistakes that lead to it.

    Args:
        consistency: evidence for readings of the detections.
        given: the files as they are.
        sizes: width and height of the pictures of each camera, pixels.

    Returns:
        The reading, the mistakes in the order found, and how well each camera agrees under it, (V,), 0 to 1.
    """
    reading, verdicts = given, []
    for _ in range(len(sizes) + 1):
        step = _best(consistency, reading, sizes)
        if step is None:
            break
        reading, verdict = step
        verdicts.append(verdict)
    return reading, verdicts, consistency.agreement(reading)


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


def _best(consistency: Consistency, reading: Reading, sizes: Sequence[Size]) -> tuple[Reading, Verdict] | None:
    """Return the reading without the likeliest mistake, and the mistake; None if none is certain.

    Crops and turns are searched only for cameras that agree badly and where no other mistake explains all of it.
    """
    best = _likeliest(consistency, reading, hypotheses(reading, sizes))
    agrees = consistency.agreement(reading if best is None else best[0])
    if best is not None and agrees.min() >= EXPLAINED * np.median(agrees) and np.median(agrees) >= EXPLAINED:
        return best
    other = _likeliest(consistency, reading, offset_pictures(consistency, reading, sizes))
    if best is None or (other is not None and other[1].gain > best[1].gain):
        return other
    return best


def _likeliest(
    consistency: Consistency, reading: Reading, candidates: Iterator[tuple[Mistake, Reading]]
) -> tuple[Reading, Verdict] | None:
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
    same = [k for k, each in enumerate(mistakes) if each.kind == named.kind and each.views == named.views]
    probability = float(np.exp(logsumexp(posterior[same]) - logsumexp([*posterior, np.log(_NOTHING)])))
    if probability < _CERTAIN or scores[best] - now < _GAIN * scores[best]:
        return None
    after, views = consistency.agreement(readings[best]), list(named.views)
    rest = np.delete(after, views)
    wanted = max(_AGREES * float(np.median(rest)) if len(rest) > 1 else 0.0, _LEAST_AGREEMENT)
    if np.mean(after[views]) < wanted:
        return None
    return readings[best], Verdict(named, probability, float(gains[best]), len(views) == len(after))
