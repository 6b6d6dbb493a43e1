"""Changes of scores as text, the same in the terminal, the Markdown summary and the JUnit report."""

from __future__ import annotations

import math

from simharness.gate.baseline import TIME
from simharness.gate.compare import Change
from simharness.runtime.number_text import fixed, signed
from simharness.scoring.catalogue import SCORES


def title(score: str) -> str:
    """Return the title of a score with its unit."""
    if score == TIME:
        return "Time, × reference"
    info = SCORES[score]
    return f"{info.title}, {info.unit}" if info.unit else info.title


def number(score: str, value: float) -> str:
    """Return a value of a score as text."""
    return fixed(value, _digits(score))


def difference(change: Change) -> str:
    """Return a change with its interval as text; a ratio for time."""
    if change.score != TIME and change.difference == change.low == change.high == 0:
        return "none"
    interval = ""
    if math.isfinite(change.low):
        interval = f" ({_difference(change.score, change.low)} to {_difference(change.score, change.high)})"
    return _difference(change.score, change.difference) + interval


def allowed(change: Change) -> str:
    """Return the changes that fail nothing as text: from the largest loss to the largest gain."""
    loss, gain = change.allowed.loss, change.allowed.gain
    if change.score == TIME:
        return f"to {_difference(TIME, math.exp(loss))}"
    info = SCORES[change.score]
    if info.target is not None:
        return f"±{gain:g}, off {info.target:g} +{loss:g}"
    low, high = (-loss, gain) if info.better == "higher" else (-gain, loss)
    return f"{low:g} to +{high:g}"


def place(change: Change) -> str:
    """Return the case of a change, or "whole suite"."""
    return change.case or "whole suite"


def sentence(change: Change) -> str:
    """Return a change as one line of text."""
    before, after = (number(change.score, value) for value in (change.before, change.after))
    return (
        f"{change.variant}, {place(change)}: {title(change.score)}: {before} before, {after} now: "
        f"{difference(change)}, allowed {allowed(change)}, p = {change.p:.2g} over {change.n} seeds"
    )


def _digits(score: str) -> int:
    return 2 if score == TIME else SCORES[score].digits


def _difference(score: str, value: float) -> str:
    return f"×{value:.2f}" if score == TIME else signed(value, max(_digits(score), 1))
