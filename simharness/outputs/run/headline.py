"""Headline scores of a summary: titles, units and number formats."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from mvpose.report.tables import NOTHING
from simharness.runtime.number_text import fixed
from simharness.scoring.catalogue import SCORES
from simharness.scoring.score_registry import in_percent


@dataclass(frozen=True)
class Column:
    """A headline score."""

    title: str
    """Short name for the head of a table."""
    unit: str
    """Unit of the number; empty for a count or a ratio."""
    about: str
    """Explanation in one line."""
    value: Callable[[Mapping[str, Any]], float | None]
    """Function that returns the number from a variant's summary, or None where it does not apply."""
    digits: int
    """Decimals."""

    def number(self, scores: Mapping[str, Any]) -> str:
        """Return the number of a variant without its unit."""
        value = self.value(scores)
        return NOTHING if value is None else fixed(value, self.digits)

    def text(self, scores: Mapping[str, Any]) -> str:
        """Return the number of a variant with its unit."""
        number = self.number(scores)
        return number if number == NOTHING or not self.unit else f"{number} {self.unit}"


COLUMNS: tuple[Column, ...] = (
    Column("PCP", "%", "body parts whose error is at most half their length", lambda s: s["pcp"], 1),
    Column("Precision", "%", "estimates that match a true person", lambda s: in_percent(s["precision"]), 1),
    Column("Recall", "%", "true people who were found, over all frames", lambda s: in_percent(s["recall"]), 1),
    Column("MPJPE", "mm", "mean joint error of the people found", lambda s: s["mpjpe_mm"]["mean"], 1),
    Column("Ghosts", "", "estimates per frame that match no person", lambda s: s["ghosts_per_frame"], 3),
    Column("Missed", "", "true people per frame who were not found", lambda s: s["missed_per_frame"], 3),
    Column("Match F1", "", "pairs of detections matched correctly", lambda s: s["matching"]["f1"], 3),
    Column("Time", "ms", "median time per frame", lambda s: s["timings_ms"]["total"]["median"], 1),
)


def scored_columns(summary: Mapping[str, Any], keys: Iterable[str] = SCORES) -> tuple[Column, ...]:
    """Return the scores of a run that any of its variants has, in the order of the keys."""
    known = [scores.get("scores", {}) for scores in summary["variants"].values()]
    return tuple(column_of(key) for key in keys if any(each.get(key) is not None for each in known))


def column_of(key: str, value: Callable[[Mapping[str, Any]], float | None] | None = None) -> Column:
    """Return the column of a score, whose number is that of the key, or what a function of a summary returns."""
    info, own = SCORES[key], lambda scores: scores.get("scores", {}).get(key)
    return Column(info.title, info.unit, info.about, value or own, info.digits)
