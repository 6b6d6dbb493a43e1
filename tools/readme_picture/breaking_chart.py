"""Chart of breaking points: PCP of the variants against the number of people, from the digest of a study."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mvpose.report.svg_plots import VARIANT_COLORS

Point = tuple[float, float]

FACTOR, SCORE = "people.count", "pcp"
"""Factor and score of the chart."""

VARIANTS = ("full", "no-3dps", "no-matching")
"""Variants with a curve."""

_WITHOUT_POINT = {"never": "does not break", "at once": "is broken throughout"}


def breaking_chart(digest: Mapping[str, Any], *, at: tuple[float, float, float, float]) -> dict[str, Any]:
    """Lay out the curves of a digest with their intervals and breaking points.

    Args:
        digest: contents of the ``digest.json`` of a study.
        at: left, top, width and height of the axes on the sheet.

    Returns:
        Values for the template: axes with ticks, and for each variant points, paths and a label.

    Raises:
        ValueError: the study does not sweep ``people.count``, or lacks a variant.
    """
    empty: dict[str, Any] = {"values": [], "scores": {}}
    factor = next((each for each in digest.get("factors", ()) if each["key"] == FACTOR), empty)
    if missing := [variant for variant in VARIANTS if variant not in factor["scores"]]:
        raise ValueError(
            f"the digest has no {SCORE} of {', '.join(missing)} against {FACTOR}; expected the digest.json of a study "
            f"that sweeps {FACTOR}, such as results/crowd/digest.json"
        )
    left, top, width, height = at
    values = factor["values"]
    scores = {variant: _known(values, factor["scores"][variant][SCORE]) for variant in VARIANTS}
    worst = min(low for line in scores.values() for _, _, low, _ in line)
    floor = math.floor(worst / 10) * 10

    def x(value: float) -> float:
        return round(left + width * (value - min(values)) / (max(values) - min(values)), 1)

    def y(score: float) -> float:
        return round(top + height * (100 - score) / (100 - floor), 1)

    breaking = {
        each["variant"]: each for each in digest["breaking"] if (each["factor"], each["score"]) == (FACTOR, SCORE)
    }
    curves = []
    for row, (variant, line) in enumerate(scores.items()):
        points = [(x(value), y(mean)) for value, mean, _, _ in line]
        lows = [(x(value), y(low)) for value, _, low, _ in line]
        highs = [(x(value), y(high)) for value, _, _, high in line]
        point = breaking[variant]["value"]
        key = (left + 0.04 * width, top + height * (0.5 + 0.2 * row))
        curves.append(
            {
                "variant": variant,
                "color": VARIANT_COLORS[row],
                "width": 3 + 2 * (len(VARIANTS) - 1 - row),  # lines that coincide stay visible
                "points": points,
                "line": path(points),
                "band": path([*lows, *reversed(highs)]) + "Z",
                "breaks": None if point is None else x(point),
                "key": f"M{key[0]:.1f} {key[1]:.1f}h28",
                "label": _WITHOUT_POINT[breaking[variant]["why"]] if point is None else f"breaks above {point:.1f}",
                "label_at": (round(key[0] + 42, 1), round(key[1] + 8, 1)),
            }
        )
    return {
        "left": left,
        "right": left + width,
        "top": top,
        "bottom": top + height,
        "down": [{"value": tick, "at": y(tick)} for tick in range(floor, 101, 10 if floor >= 40 else 20)],
        "along": [{"value": value, "at": x(value)} for value in values],
        "threshold": y(breaking[VARIANTS[0]]["threshold"]),
        "curves": curves,
    }


def path(points: Iterable[Point]) -> str:
    """Return a line through points as the data of an SVG path."""
    return "M" + "L".join(f"{x} {y}" for x, y in points)


def _known(values: Sequence[float], scores: Sequence[Any]) -> list[tuple[float, float, float, float]]:
    """Return value, mean and ends of the interval where there is a mean; for a single seed the ends are the mean."""
    return [
        (value, ends[0], *(ends[0] if end is None else end for end in ends[1:]))
        for value, ends in zip(values, scores, strict=True)
        if ends is not None
    ]
