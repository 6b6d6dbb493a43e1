"""Formatting of results as aligned text: tables, figures, bars."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

MET, MISSED = "✓", "✗"
RULE = "─"
WIDTH = 100  # columns
_EIGHTHS = " ▏▎▍▌▋▊▉█"
_PLAIN = str.maketrans(
    {"✓": "+", "✗": "!", "─": "-", "█": "#", "×": "x", "·": "|", "≤": "<=", **dict.fromkeys(_EIGHTHS[1:-1], "#")}
)


def table(rows: Sequence[Sequence[str]], align: str, *, gap: int = 2, rules: Sequence[int] = (0,)) -> str:
    """Format cells as a table with columns as wide as their widest cell.

    Args:
        rows: cells, the same number in every row.
        align: alignment, one of ``<>^`` for each column.
        gap: number of spaces between columns.
        rules: indices of rows under which a line is drawn.
    """
    widths = [max(len(row[column]) for row in rows) for column in range(len(align))]
    lines = []
    for index, row in enumerate(rows):
        cells = [f"{cell:{side}{width}}" for cell, side, width in zip(row, align, widths, strict=True)]
        lines.append((" " * gap).join(cells).rstrip())
        if index in rules:
            lines.append(RULE * (sum(widths) + gap * (len(widths) - 1)))
    return "\n".join(lines)


def caption(text: str) -> str:
    """Format the caption under a table, wrapped to the page width."""
    return "\n\n" + textwrap.fill(text, WIDTH)


def figure(value: float) -> str:
    """Format a number with three significant digits and at most four decimals: 0.0521, 0.600, 70.2, 5555."""
    if value == 0:
        return "0"
    places = min(max(0, 2 - math.floor(math.log10(abs(value)))), 4)
    return f"{value:.{places}f}"


def against(value: float, target: float | None) -> tuple[str, str]:
    """Return two cells: whether a figure meets the target that it should not exceed, and the target; empty without."""
    if target is None:
        return "", ""
    return MET if value <= target else MISSED, f"{target:g}"


def bar(value: float, low: float, high: float, *, width: int) -> str:
    """Draw a bar on a logarithmic scale, empty at ``low`` and full at ``high``."""
    share = math.log(value / low) / math.log(high / low) if high > low else 1.0
    eighths = round(8 * width * min(max(share, 0.0), 1.0))
    return _EIGHTHS[8] * (eighths // 8) + (_EIGHTHS[eighths % 8] if eighths % 8 else "")


def encodable(text: str, encoding: str | None) -> str:
    """Return the text, with ASCII in place of symbols that the encoding of the terminal lacks."""
    try:
        text.encode(encoding or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return text.translate(_PLAIN).encode("ascii", "replace").decode()
    return text
