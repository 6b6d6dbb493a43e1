"""Plots of a page as one picture that stands by itself: an SVG file with ink and paper of its own."""

from __future__ import annotations

import re
from collections.abc import Sequence

_COLORS = {"currentColor": "#1b1d21", "var(--faint)": "#666b75", "var(--line)": "#dedfe0"}
_PAPER = "#ffffff"
_GAP = 14.0  # points between plots, and about them
_SCALE = 1.3  # plots are made for the width of a phone


def sheet(rows: Sequence[Sequence[str]]) -> str:
    """Lay plots out in rows.

    Args:
        rows: of SVG elements as :mod:`simharness.report.study.plots` makes them; each with its viewBox.

    Returns:
        An SVG document.

    Raises:
        ValueError: a plot without a viewBox.
    """
    placed, top, widest = [], _GAP, 0.0
    for row in rows:
        left = _GAP
        sizes = [_size(plot) for plot in row]
        for plot, (width, height) in zip(row, sizes, strict=True):
            place = f'<svg x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
            placed.append(plot.replace("<svg", place, 1))
            left += width + _GAP
        top += max((height for _, height in sizes), default=0.0) + _GAP
        widest = max(widest, left)
    drawn = "\n".join(placed)
    for on_page, color in _COLORS.items():
        drawn = drawn.replace(on_page, color)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'width="{_SCALE * widest:g}" height="{_SCALE * top:g}" viewBox="0 0 {widest:g} {top:g}">\n'
        f'<rect width="100%" height="100%" fill="{_PAPER}"/>\n{drawn}\n</svg>\n'
    )


def _size(plot: str) -> tuple[float, float]:
    found = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', plot)
    if found is None:
        raise ValueError(f"a plot must have a viewBox from 0 0, got {plot[:60]!r}")
    return float(found[1]), float(found[2])
