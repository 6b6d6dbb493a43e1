"""Section of a page on what cost the score: the sentence that decides, and a table with the shares as bars."""

from functools import partial
from typing import Any

import numpy as np

from simharness.scoring.catalogue import SCORES
from simharness.study.causes.blame_text import conclusion, ends, gain, heading, points, surest
from simharness.study.causes.cause_catalogue import causes_by_name
from simharness.study.causes.cause_shares import Blame

_WIDTH = 240.0  # of a bar's drawing, px


def blame_section(found: Blame) -> dict[str, Any]:
    """Return what ``blame.html`` shows of a blame: its sentences, and functions that write and place its numbers.

    The scale of the bars holds all means. Intervals of few seeds are wider, and run out of it.
    """
    known = [0.0, found.rest.mean, *(number.mean for each in found.shares for number in (each.share, each.alone))]
    room = 0.12 * max(max(known) - min(known), 0.5)
    low, high = min(known) - room * (min(known) < 0), max(known) + room
    return {
        "found": found,
        "heading": heading(found),
        "conclusion": conclusion(found),
        "caution": surest(found),
        "absent": [cause.title for cause in causes_by_name(found.absent)],
        "score": SCORES[found.score].title,
        "points": partial(points, interval=False),
        "gain": partial(gain, interval=False),
        "ends": ends,
        "across": lambda value: float(np.clip(_WIDTH * (value - low) / (high - low), 0.0, _WIDTH)),
    }
