"""Sentences, numbers and files of a blame, for pages, terminals and result folders."""

import json
from pathlib import Path

import numpy as np

from mvpose.files.atomic_files import write_atomic
from mvpose.files.input_files import read_json_object
from mvpose.files.message_text import prefixed
from simharness.runtime.number_text import fixed, signed
from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import Interval
from simharness.study.causes.cause_shares import RESTORED, Blame

_DIGITS = 1  # of differences of scores


def points(number: Interval, *, interval: bool = True) -> str:
    """Return a difference of scores, with its interval where wanted: "2.5 (−1.4 to 6.9)"."""
    return _minus(fixed(number.mean, _DIGITS)) + (_ends(number, _DIGITS) if interval else "")


def heading(blame: Blame) -> str:
    """Return what was found in a line: the score as it is, and with all causes mended."""
    info = SCORES[blame.score]
    return f"{info.title} {_value(blame, blame.before)}, {_value(blame, blame.after)} with all causes mended"


def conclusion(blame: Blame) -> str:
    """Return what to mend first, in a sentence or two; nothing where the seeds do not show that it helps."""
    info = SCORES[blame.score]
    if blame.mending is None:
        return f"In these seeds mending all causes together does not improve {info.title}: nothing is to be gained."
    mending = blame.mending
    what = ", ".join(cause.title for cause in mending.about)
    if not mending.gain.low > 0:
        return f"No cause is certain: mending {what} gains {points(mending.gain)} points. {_more_seeds(mending.gain)}"
    after = f"{_value(blame, mending.score)}{_ends(mending.score, info.digits)}"
    part = f"{100 * mending.restored:.0f} % of what mending everything would gain"
    if mending.restored < RESTORED:
        return (
            f"The largest causes together are not enough. With these mended, {what}, {info.title} is {after}: {part}."
        )
    return f"Mend first: {what}. {info.title} is then {after}: {part}."


def surest(blame: Blame) -> str:
    """Return whether the largest share is above zero for certain, in a sentence; empty where no cause is certain."""
    if blame.mending is None or not blame.shares or not blame.mending.gain.low > 0:
        return ""
    first = blame.shares[0]
    if first.share.low > 0:
        return f"The largest cause is {first.about.title}, {points(first.share)} points."
    return f"Which cause is the largest is not certain: {first.about.title} has {points(first.share)} points."


def _more_seeds(gain: Interval) -> str:
    """Return the advice to run more seeds, with the number at which the interval would end at zero, if it shrinks."""
    if not np.isfinite(gain.low):
        return "A single seed has no intervals: run more seeds."
    needed = gain.n * ((gain.mean - gain.low) / gain.mean) ** 2 if gain.mean > 0 else np.inf
    return f"Run more seeds, about {-(-needed // 5) * 5:.0f}." if needed <= 1000 else "Run many more seeds."


def gain(number: Interval, *, interval: bool = True) -> str:
    """Return a gain with its sign, and its interval where wanted: "+2.5 (−1.4 to 6.9)"."""
    return _minus(signed(number.mean, _DIGITS)) + (_ends(number, _DIGITS) if interval else "")


def ends(number: Interval) -> str:
    """Return the interval of a difference of scores: "−1.4 to 6.9"; empty where there is none."""
    return _ends(number, _DIGITS).strip(" ()")


def _value(blame: Blame, interval: Interval) -> str:
    info = SCORES[blame.score]
    return f"{fixed(interval.mean, info.digits)}{f' {info.unit}' if info.unit else ''}"


def _ends(interval: Interval, digits: int) -> str:
    ends = _minus(interval.texts(digits)[1])
    return f" ({ends})" if ends else ""


def _minus(number: str) -> str:
    return number.replace("-", "−")


FILE = "blame.json"
"""Name of the file in a result folder."""


def write_blame(found: Blame, folder: Path) -> None:
    """Write the file into a result folder."""
    write_atomic(folder / FILE, (json.dumps(found.json(), indent=1, allow_nan=False) + "\n").encode())


def read_blame(folder: Path) -> Blame | None:
    """Read the file of a result folder; None where it has none.

    Raises:
        ValueError: a damaged file.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    with prefixed(path, "; remove it, or write it again with --blame"):
        return Blame.of_json(read_json_object(path, what="what cost the score"))
