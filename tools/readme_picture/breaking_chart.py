"""Where variants of the method break: PCP against the number of cameras, from the digest of a study, as plain SVG."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from simharness.report.figures.svg_plots import VARIANT_COLORS

Point = tuple[float, float]

FACTOR, SCORE = "cameras.count", "pcp"
"""What the last panel plots a score against, and which."""

VARIANTS = ("full", "no-3dps", "no-matching")
"""Whose curves it shows."""

_WHY = {"never": "does not break", "at once": "is broken throughout"}


def breaking_chart(digest: Mapping[str, Any], *, at: tuple[float, float, float, float]) -> dict[str, Any]:
    """Lay out the curves of a digest with their intervals, and where they pass the threshold.

    Args:
        digest: of a study: its ``digest.json``.
        at: left, top, width and height of the axes on the sheet.

    Returns:
        What the template draws: axes with their ticks, and for each variant points, paths, and what is told of it.

    Raises:
        ValueError: the study does not sweep ``cameras.count``, or lacks a variant.
    """
    nothing: dict[str, Any] = {"values": [], "scores": {}}
    factor = next((each for each in digest.get("factors", ()) if each["key"] == FACTOR), nothing)
    if missing := [variant for variant in VARIANTS if variant not in factor["scores"]]:
        raise ValueError(
            f"the digest has no {SCORE} of {', '.join(missing)} against {FACTOR}: expected the digest.json of a study "
            "that sweeps it, such as results/views/digest.json"
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
        key = (left + 0.38 * width, top + height * (0.5 + 0.2 * row))
        curves.append(
            {
                "variant": variant,
                "color": VARIANT_COLORS[row],
                "width": 3 + 2 * (len(VARIANTS) - 1 - row),  # so that lines that coincide are all seen
                "points": points,
                "line": path(points),
                "band": path([*lows, *reversed(highs)]) + "Z",
                "breaks": None if point is None else x(point),
                "key": f"M{key[0]:.1f} {key[1]:.1f}h28",
                "told": _WHY[breaking[variant]["why"]] if point is None else f"breaks below {point:.1f}",
                "told_at": (round(key[0] + 42, 1), round(key[1] + 8, 1)),
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
    """A line through points as SVG has it."""
    return "M" + "L".join(f"{x} {y}" for x, y in points)


def _known(values: Sequence[float], scores: Sequence[Any]) -> list[tuple[float, float, float, float]]:
    """Value, mean and the ends of its interval wherever there is a mean; of a single seed the ends are the mean."""
    return [
        (value, ends[0], *(ends[0] if end is None else end for end in ends[1:]))
        for value, ends in zip(values, scores, strict=True)
        if ends is not None
    ]
