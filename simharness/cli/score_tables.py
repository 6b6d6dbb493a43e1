"""Tables of scores in a terminal: a table that is wider than the terminal is divided, and nothing is cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

_UNLIMITED = 10_000  # columns of a terminal in which everything fits


@dataclass(frozen=True)
class ScoreTable:
    """Scores by row.

    Attributes:
        title: title above the table.
        labels: headings of the columns that name a row.
        scores: headings of the columns of scores.
        rows: cells of every row: its labels, then its scores; a cell or a heading may have several lines.
    """

    title: str
    labels: Sequence[str]
    scores: Sequence[str]
    rows: Sequence[Sequence[str]]

    def print_to(self, console: Console) -> None:
        """Print the table; where it does not fit, the scores that follow are in another table below, with the labels.

        Labels that leave no room for a single score are broken into lines.
        """
        unlimited = console.options.update(width=_UNLIMITED)
        start = 0
        while start < len(self.scores):
            end = len(self.scores)
            while (
                end > start + 1 and console.measure(self._part(start, end), options=unlimited).maximum > console.width
            ):
                end -= 1
            console.print(self._part(start, end))
            start = end

    def _part(self, start: int, end: int) -> Table:
        """Return the table with the scores from ``start`` up to ``end``."""
        table = Table(
            title=Text(f"{self.title}, continued" if start else self.title),
            title_justify="left",
            title_style="bold",
            box=SIMPLE_HEAD,
            show_edge=False,
            pad_edge=False,
            padding=(0, 1, 0, 0),
        )
        for label in self.labels:
            table.add_column(Text(label), overflow="fold")
        for score in self.scores[start:end]:
            table.add_column(Text(score), justify="right", no_wrap=True)
        count = len(self.labels)
        for row in self.rows:
            table.add_row(*map(Text, (*row[:count], *row[count + start : count + end])))
        return table
