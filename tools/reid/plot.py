"""The card of a network as a picture: ``python -m tools.reid.plot reid.json look_alike.png``."""

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
_BOX = (0.05, 0.5, 0.95)  # quantiles that are drawn


def plot(card: Mapping[str, Any], path: Path) -> None:
    """Draw how people are told apart, and the distances behind it, the more alike they are dressed.

    Args:
        card: of a network (:mod:`tools.reid.card`).
        path: of the PNG.
    """
    figure = Figure(figsize=(9.6, 3.6), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    _curves(left, card["results"]["look_alike"])
    _distances(right, card["distances"], card["affinity"]["midpoint"])
    for axes in (left, right):
        axes.set_xlabel("look_alike: 0 dressed differently, 1 in one uniform")
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", color="#e3e6ea", linewidth=0.7)
        axes.set_axisbelow(True)
    figure.savefig(path)


def _curves(axes: Axes, curve: Mapping[str, Any]) -> None:
    dials = sorted(curve, key=float)
    at = [float(dial) for dial in dials]
    for key, color, name in (("network", _NETWORK, "network"), ("histogram_balanced", _COLOURS, "colours alone")):
        for score, style in (("rank1", "-"), ("mAP", "--")):
            axes.plot(
                at, [curve[dial][key][score] for dial in dials], style, color=color, marker="o", markersize=4,
                label=f"{name}, {'rank-1' if score == 'rank1' else score}",
            )  # fmt: skip
    axes.set_ylim(0, 100)
    axes.set_title("Told apart across cameras, %: 12 people, up to half hidden", loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left")


def _distances(axes: Axes, distances: Mapping[str, Any], midpoint: float) -> None:
    dials = sorted(distances["look_alike"], key=float)
    places = [distances["quantiles"].index(rank) for rank in _BOX]
    for kind, color, shift in (("same", _NETWORK, -0.025), ("other", _OTHER, 0.025)):
        for k, dial in enumerate(dials):
            low, middle, high = (distances["look_alike"][dial][kind]["all"]["quantiles"][place] for place in places)
            x = float(dial) + shift
            axes.plot([x, x], [low, high], color=color, alpha=0.45, linewidth=5, solid_capstyle="butt")
            axes.plot(x, middle, "o", color=color, markersize=5, label=None if k else f"{_WHO[kind]}, 5 to 95 %")
    axes.axhline(midpoint, color="#2a2f38", linewidth=0.9, linestyle=":", label="as likely as not of one person")
    axes.set_ylim(0.2, 1.55)
    axes.set_title("Distance of descriptors of one moment in two views", loc="left", fontsize=10)
    axes.legend(frameon=False, fontsize=8.5, loc="lower left")


_WHO = {"same": "one person", "other": "two people"}


if __name__ == "__main__":
    plot(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
