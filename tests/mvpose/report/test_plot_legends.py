"""Legends above plots: within the plot, in few rows, and without an effect on the size of the axes."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from mvpose.report.svg_plots import legend_above, svg_plot

WIDTH = 5.2 * 72  # points
PEOPLE = [f"person {i}" for i in range(6)]
LINE_HEIGHT = 14.0  # points, with the gap between the rows


def drawn(names, columns=None):
    """Draw a square plot with a legend; return the boxes of axes and legend, points, and the labels of each row."""
    with svg_plot("legend", size=(5.2, 4.8)) as (axes, _):
        for name in names:
            axes.plot([0, 1], [0, 1], label=name)
        axes.set_aspect("equal")
        legend_above(axes, columns=columns)
        figure = axes.get_figure(root=True)
        FigureCanvasAgg(figure).draw()
        [legend] = figure.legends
        rows = {}
        for text in legend.get_texts():
            rows.setdefault(round(text.get_window_extent().y0), []).append(text.get_text())
        boxes = [each.get_window_extent().extents * 72 / figure.dpi for each in (axes, legend)]
    return *boxes, [rows[height] for height in sorted(rows, reverse=True)]


@pytest.mark.parametrize("names", [["full", "fast"], PEOPLE, [*PEOPLE, "estimated"], ["wwwwww"] * 11, ["x" * 40] * 4])
def test_a_legend_lies_above_the_axes_within_the_plot_and_does_not_narrow_them(names):
    plain, _, _ = drawn(["a"])
    axes, legend, rows = drawn(names)
    assert legend[0] >= 0.0
    assert legend[2] <= WIDTH
    assert axes[3] <= legend[1]
    assert axes[2] - axes[0] >= plain[2] - plain[0] - LINE_HEIGHT * (len(rows) - 1)


@pytest.mark.parametrize(("names", "rows"), [(["full", "fast"], 1), (PEOPLE, 1), ([*PEOPLE, "estimated"], 2)])
def test_a_legend_has_one_row_where_that_fits(names, rows):
    assert len(drawn(names)[2]) == rows


def test_rows_of_a_legend_are_filled_evenly():
    _, _, rows = drawn([*PEOPLE, "estimated"])
    assert rows == [["person 0", "person 2", "person 4", "estimated"], ["person 1", "person 3", "person 5"]]


def test_a_legend_has_no_more_columns_than_allowed():
    assert drawn(["a", "b", "c"], columns=2)[2] == [["a", "c"], ["b"]]
