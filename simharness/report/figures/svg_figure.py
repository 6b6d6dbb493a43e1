"""What the plots of a report share: SVG that takes its ink and grid from the page, one for light and dark."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

Color = str

# Stand-ins that matplotlib writes into the SVG and that become the page's own colours.
INK, FAINT, LINE = "#010203", "#010204", "#010205"
_OF_PAGE = {INK: "currentColor", FAINT: "var(--faint)", LINE: "var(--line)"}

SIZE = (5.2, 3.1)  # inches of 72 px: small, so that the letters stay readable on a phone

VISIBILITY_COLORS: tuple[Color, ...] = ("#2e9e6b", "#d9a514", "#d9643a", "#8a63c9", "#8b93a1")
STAGE_COLORS: Mapping[str, Color] = {
    "affinity": "#3b82c4",
    "matching": "#d9a514",
    "reconstruction": "#2e9e6b",
    "method": "#8b93a1",
}
VARIANT_COLORS: tuple[Color, ...] = ("#3b82c4", "#d9643a", "#2e9e6b", "#8a63c9", "#d9a514", "#c2568f")

_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: the page's font, found by the browser's search
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "font.size": 9,
    "axes.titlesize": 9,
    "text.color": INK,
    "axes.labelcolor": FAINT,
    "axes.edgecolor": LINE,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": FAINT,
    "ytick.labelcolor": FAINT,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}


@contextmanager
def figure(name: str, *, size: tuple[float, float] = SIZE) -> Iterator[tuple[Axes, list[str]]]:
    """Axes to draw on; the SVG is in the list afterwards."""
    written: list[str] = []
    with mpl.rc_context({**_STYLE, "svg.hashsalt": name}):  # the salt keeps the ids of two plots of a page apart
        sheet = Figure(figsize=size, layout="constrained")
        axes = sheet.add_subplot()
        axes.set_axisbelow(True)
        yield axes, written
        buffer = io.StringIO()
        FigureCanvasSVG(sheet).print_svg(buffer, metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    sheet.clear()
    written.append(_for_page(buffer.getvalue()))


def _for_page(svg: str) -> str:
    """Only the element, as wide as its place, in the page's colours."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    # Ids that two plots would share, and that nothing refers to.
    svg = re.sub(r' id="[a-zA-Z0-9.]+_\d+"', "", svg)
    for stand_in, color in _OF_PAGE.items():
        svg = svg.replace(stand_in, color)
    return re.sub(r"\n\s*", "\n", svg).strip()


def legend(axes: Axes, *, columns: int) -> None:
    """Above the axes, out of the way of the data."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0, 1.0),
            ncols=columns,
            labelcolor=INK,
            handlelength=1.1,
            columnspacing=1.2,
            borderaxespad=0.2,
        )
