"""Matplotlib plots as SVG: inline in a page, in its own colours, or arranged in one standalone file; or as PDF."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

Color = str

# Colours on paper, which nothing else in a plot has: in a page each becomes a colour of the page, light or dark.
INK, FAINT, LINE = "#1b1d21", "#666b75", "#dedfe0"
_PAGE_COLORS = {INK: "currentColor", FAINT: "var(--faint)", LINE: "var(--line)"}
_PAPER = "#ffffff"

SIZE = (5.2, 3.1)  # inches of 72 px: small, so that the letters stay readable on a phone
_LEGEND_SIZES = (8.5, 8.0, 7.5)  # points, from the usual to the smallest
_MARK, _MARK_GAP, _COLUMN_GAP, _EDGE_GAP = 1.1, 0.8, 1.2, 0.6  # widths in a legend, as shares of the font size
_SHEET_GAP = 14.0  # points between the plots of a sheet, and around them
_SHEET_SCALE = 1.3  # plots have the width of a phone; a sheet is shown on wider screens

STAGE_COLORS: Mapping[str, Color] = {
    "affinity": "#3b82c4",
    "matching": "#d9a514",
    "reconstruction": "#2e9e6b",
    "method": "#8b93a1",
}
VARIANT_COLORS: tuple[Color, ...] = ("#3b82c4", "#d9643a", "#2e9e6b", "#8a63c9", "#d9a514", "#c2568f")

STYLE = mpl.rc_params_from_file(Path(__file__).parent / "templates" / "plots.mplstyle", use_default_template=False)
"""Settings of Matplotlib for all plots."""

_PDF_FOLDER: ContextVar[Path | None] = ContextVar("pdf_folder", default=None)


@contextmanager
def plots_as_pdf(folder: Path) -> Iterator[None]:
    """Write the plots that are made in this context also as NAME.pdf into a folder, in the colours of paper."""
    before = _PDF_FOLDER.set(folder)
    try:
        yield
    finally:
        _PDF_FOLDER.reset(before)


@contextmanager
def svg_plot(name: str, *, size: tuple[float, float] = SIZE) -> Iterator[tuple[Axes, list[str]]]:
    """Give axes to draw on, and a list that holds the SVG element when the context ends.

    Args:
        name: different from the name of every other plot on the page, so that no two plots share ids.
        size: width and height in inches of 72 px.
    """
    written: list[str] = []
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.add_subplot()
        axes.set_axisbelow(True)
        yield axes, written
        buffer = io.StringIO()
        FigureCanvasSVG(figure).print_svg(
            buffer, metadata={"Date": None, "Creator": None, "Format": None, "Type": None}
        )
        if (folder := _PDF_FOLDER.get()) is not None:
            file = re.sub(r"[^\w.-]+", "_", name)
            FigureCanvasPdf(figure).print_pdf(folder / f"{file}.pdf", metadata={"CreationDate": None})
    figure.clear()
    written.append(_inline(buffer.getvalue()))


def _inline(svg: str) -> str:
    """Return only the SVG element, without a fixed size, in the colours of the page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    # Remove ids that nothing refers to: they would be the same in two plots.
    svg = re.sub(r' id="[a-zA-Z0-9.]+_\d+"', "", svg)
    for placeholder, color in _PAGE_COLORS.items():
        svg = svg.replace(placeholder, color)
    return re.sub(r"\n\s*", "\n", svg).strip()


def legend_above(axes: Axes, *, columns: int | None = None) -> None:
    """Draw the legend above the plot, from its left edge, where it hides no data; nothing where no line has a label.

    It has one row where that fits, if need be in smaller letters, and else the fewest rows that fit. It belongs to the
    figure: a legend of the axes would make axes of a fixed aspect as small as it takes to be as wide as the legend.

    Args:
        axes: the plot.
        columns: most columns; None: all labels.
    """
    handles, names = axes.get_legend_handles_labels()
    if names:
        figure = axes.get_figure(root=True)
        assert figure is not None
        fitting, size = _fitting_columns([text_width(name) for name in names], 72 * figure.get_figwidth())
        figure.legend(
            handles,
            names,
            loc="outside upper left",
            ncols=min(fitting, columns or fitting),
            fontsize=size,
            labelcolor=INK,
            handlelength=_MARK,
            handletextpad=_MARK_GAP,
            columnspacing=_COLUMN_GAP,
            borderpad=_EDGE_GAP / 2,
            borderaxespad=_EDGE_GAP / 2,
        )


def text_width(text: str) -> float:
    """Return the width of a text in Matplotlib's own font, which is wider than those of most pages, in font sizes."""
    width, _, _ = text_to_path.get_text_width_height_descent(text, FontProperties(size=100), ismath=False)
    return float(width) / 100


def _fitting_columns(texts: Sequence[float], width: float) -> tuple[int, float]:
    """Return the most columns of labels that fit into a width in points, and their font size.

    Args:
        texts: widths of the labels, as shares of the font size.
        width: width of the plot, points.
    """
    for rows in range(1, len(texts) + 1):
        columns = -(-len(texts) // rows)  # labels fill one column after the other
        widest = [each.max() + _MARK + _MARK_GAP for each in np.array_split(texts, columns)]
        for size in _LEGEND_SIZES if rows == 1 else _LEGEND_SIZES[:1]:
            if (sum(widest) + (columns - 1) * _COLUMN_GAP + 2 * _EDGE_GAP) * size <= width:
                return columns, size
    return 1, _LEGEND_SIZES[0]


def plot_sheet(rows: Sequence[Sequence[str]]) -> str:
    """Arrange plots in rows as one standalone SVG file with a white background.

    Args:
        rows: SVG elements from :func:`svg_plot`, each with a viewBox.

    Returns:
        An SVG document.

    Raises:
        ValueError: a plot has no viewBox.
    """
    placed, top, widest = [], _SHEET_GAP, 0.0
    for row in rows:
        left = _SHEET_GAP
        sizes = [_size(plot) for plot in row]
        for plot, (width, height) in zip(row, sizes, strict=True):
            element = f'<svg x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
            placed.append(plot.replace("<svg", element, 1))
            left += width + _SHEET_GAP
        top += max((height for _, height in sizes), default=0.0) + _SHEET_GAP
        widest = max(widest, left)
    plots = "\n".join(placed)
    for color, page_color in _PAGE_COLORS.items():
        plots = plots.replace(page_color, color)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'width="{_SHEET_SCALE * widest:g}" height="{_SHEET_SCALE * top:g}" viewBox="0 0 {widest:g} {top:g}">\n'
        f'<rect width="100%" height="100%" fill="{_PAPER}"/>\n{plots}\n</svg>\n'
    )


def _size(plot: str) -> tuple[float, float]:
    """Return width and height of a plot in points, from its viewBox."""
    match = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', plot)
    if match is None:
        raise ValueError(f"a plot must have a viewBox that starts at 0 0, got {plot[:60]!r}")
    return float(match[1]), float(match[2])
