"""Plot of the scores in a network's card: ``python -m tools.reid.plot reid.json look_alike.png``."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

_NETWORK, _COLOURS, _OTHER = "#3b82c4", "#d9643a", "#8b93a1"
_BOX = (0.05, 0.5, 0.95)  # drawn quantiles


def plot(card: Mapping[str, Any], path: Path) -> None:
    """Plot retrieval scores and distances of descriptors over ``look_alike``.

    Args:
        card: card of a network (:mod:`tools.reid.card`).
        path: path of the PNG file.
    """
    figure = Figure(figsize=(9.6, 3.6), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    _curves(left, card["results"]["look_alike"])
    _distances(right, card["distances"], card["affinity"]["midpoint"])
    for axes in (left, right):
        axes.set_xlabel("look_alike: 0 distinct clothes, 1 the same uniform")
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", color="#e3e6ea", linewidth=0.7)
        axes.set_axisbelow(True)
    figure.savefig(path)


def _curves(axes: Axes, curve: Mapping[str, Any]) -> None:
    """Plot the retrieval scores of the network and of colour histograms."""
    values = sorted(curve, key=float)
    at = [float(value) for value in values]
    for key, color, name in (("network", _NETWORK, "network"), ("histogram_balanced", _COLOURS, "histogram")):
        for score, style in (("rank1", "-"), ("mAP", "--")):
            axes.plot(
                at, [curve[value][key][score] for value in values], style, color=color, marker="o", markersize=4,
                label=f"{name}, {'rank-1' if score == 'rank1' else score}",
            )  # fmt: skip
    axes.set_ylim(0, 100)
    axes.set_title("Retrieval across cameras, %: 12 people, up to half hidden", loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left")


def _distances(axes: Axes, distances: Mapping[str, Any], midpoint: float) -> None:
    """Plot the median and the 5 to 95 % range of distances for the same person and for two people."""
    values = sorted(distances["look_alike"], key=float)
    columns = [distances["quantiles"].index(rank) for rank in _BOX]
    for kind, color, shift in (("same", _NETWORK, -0.025), ("other", _OTHER, 0.025)):
        for k, value in enumerate(values):
            low, middle, high = (distances["look_alike"][value][kind]["all"]["quantiles"][c] for c in columns)
            x = float(value) + shift
            axes.plot([x, x], [low, high], color=color, alpha=0.45, linewidth=5, solid_capstyle="butt")
            axes.plot(x, middle, "o", color=color, markersize=5, label=None if k else f"{_KINDS[kind]}, 5 to 95 %")
    axes.axhline(midpoint, color="#2a2f38", linewidth=0.9, linestyle=":", label="one and two people equally likely")
    axes.set_ylim(0.2, 1.55)
    axes.set_title("Distance of descriptors in two views at one moment", loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left")


_KINDS = {"same": "one person", "other": "two people"}


if __name__ == "__main__":
    plot(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
