"""The headline numbers of a summary: what they are called, how they are written, which way is better."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

NOTHING = "–"  # a score that does not apply


@dataclass(frozen=True)
class Column:
    """One headline number.

    Attributes:
        title: short, for a table.
        unit: of the number; empty for a count or a ratio.
        about: one line for whoever sees it for the first time.
        value: the number in a variant's summary, or None.
        digits: behind the point.
    """

    title: str
    unit: str
    about: str
    value: Callable[[Mapping[str, Any]], float | None]
    digits: int

    def number(self, scores: Mapping[str, Any]) -> str:
        """The number of a variant, for a column that tells the unit."""
        value = self.value(scores)
        return NOTHING if value is None else f"{value:.{self.digits}f}"

    def text(self, scores: Mapping[str, Any]) -> str:
        """The number of a variant with its unit."""
        number = self.number(scores)
        return number if number == NOTHING or not self.unit else f"{number} {self.unit}"


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


COLUMNS: tuple[Column, ...] = (
    Column("PCP", "%", "body parts placed within half their length", lambda s: s["pcp"], 1),
    Column("Precision", "%", "estimated people who are true ones", lambda s: _percent(s["precision"]), 1),
    Column("Recall", "%", "true people found, over all frames", lambda s: _percent(s["recall"]), 1),
    Column("MPJPE", "mm", "mean joint error of those found", lambda s: s["mpjpe_mm"]["mean"], 1),
    Column("Ghosts", "", "estimated people a frame who are not there", lambda s: s["ghosts_per_frame"], 3),
    Column("Missed", "", "true people a frame who are not found", lambda s: s["missed_per_frame"], 3),
    Column("Match F1", "", "detections put together rightly", lambda s: s["matching"]["f1"], 3),
    Column("Time", "ms", "median of a frame", lambda s: s["timings_ms"]["total"]["median"], 1),
)
