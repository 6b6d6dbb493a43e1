"""Section of a page on what cost the score: the sentence that decides, and a table with the shares as bars."""

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from simharness.scoring.catalogue import SCORES
from simharness.statistics.intervals import Interval
from simharness.study.causes.blame_text import conclusion, ends, gain, heading, points, surest
from simharness.study.causes.cause_catalogue import causes_by_name
from simharness.study.causes.cause_shares import Blame

_WIDTH, _HEIGHT = 240.0, 18.0  # of a bar's drawing, px


@dataclass(frozen=True)
class BlameRow:
    """Row of the table: a cause, or what no cause explains."""

    title: str
    """Name of the cause."""
    mended: str
    """What a user has who mends it."""
    bar: Markup
    """Drawing of the share with its interval, and of the gain alone."""
    numbers: tuple[tuple[str, str], ...]
    """Share, gain alone and gain last, each with its interval; empty where there is none."""


@dataclass(frozen=True)
class BlameSection:
    """What a template shows of a blame."""

    found: Blame
    """The blame."""
    heading: str
    """The score as it is and with all causes mended."""
    conclusion: str
    """What to mend first."""
    caution: str
    """Whether the intervals allow to decide."""
    rows: tuple[BlameRow, ...]
    """The causes, the largest share first, and last what no cause explains."""
    absent: tuple[str, ...]
    """Titles of the causes that the scenario does not have."""
    score: str
    """Title of the score."""


def blame_section(found: Blame) -> BlameSection:
    """Return what a page shows of a blame."""
    span = _span(found)
    rows = [
        BlameRow(
            each.about.title,
            each.about.mended,
            share_bar(each.share, each.alone, span=span),
            (
                (points(each.share, interval=False), ends(each.share)),
                *((gain(number, interval=False), ends(number)) for number in (each.alone, each.last)),
            ),
        )
        for each in found.shares
    ]
    rest = (points(found.rest, interval=False), ends(found.rest))
    rows.append(
        BlameRow(
            "no cause here",
            "what is lost with everything mended",
            share_bar(found.rest, None, span=span, faint=True),
            (rest, ("–", ""), ("–", "")),
        )
    )
    return BlameSection(
        found=found,
        heading=heading(found),
        conclusion=conclusion(found),
        caution=surest(found),
        rows=tuple(rows),
        absent=tuple(cause.title for cause in causes_by_name(found.absent)),
        score=SCORES[found.score].title,
    )


def _span(found: Blame) -> tuple[float, float]:
    """Return the ends of the scale of the bars: all means. Intervals of few seeds are wider, and run out of it."""
    known = [0.0, found.rest.mean, *(number.mean for each in found.shares for number in (each.share, each.alone))]
    room = 0.12 * max(max(known) - min(known), 0.5)
    return min(known) - room * (min(known) < 0), max(known) + room


def share_bar(share: Interval, alone: Interval | None, *, span: tuple[float, float], faint: bool = False) -> Markup:
    """Draw a share as a bar with its interval as a line, and the gain of mending the cause alone as a ring, as SVG.

    Args:
        share: the share.
        alone: the gain alone; None draws no ring.
        span: values at the two ends of the drawing.
        faint: draw a grey bar.
    """

    def across(value: float) -> float:
        return float(np.clip(_WIDTH * (value - span[0]) / (span[1] - span[0]), 0.0, _WIDTH))

    zero, end, middle = across(0.0), across(share.mean), _HEIGHT / 2
    parts = [
        f'<rect x="{min(zero, end):.1f}" y="3" width="{abs(end - zero):.1f}" height="{_HEIGHT - 6:g}" rx="2" '
        f'fill="{"var(--line)" if faint else "var(--cause)"}"/>',
        f'<path d="M{zero:.1f} 0V{_HEIGHT:g}" stroke="var(--faint)"/>',
    ]
    if np.isfinite(share.low) and share.high > share.low:
        parts.append(f'<path d="M{across(share.low):.1f} {middle:g}H{across(share.high):.1f}" stroke="currentColor"/>')
    if alone is not None:
        parts.append(
            f'<circle cx="{across(alone.mean):.1f}" cy="{middle:g}" r="3.6" fill="none" stroke="currentColor"/>'
        )
    return Markup(
        f'<svg viewBox="0 0 {_WIDTH:g} {_HEIGHT:g}" width="{_WIDTH:g}" height="{_HEIGHT:g}" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )
