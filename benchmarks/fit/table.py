"""Tables of the closed loop: truth, mean fit, bias, root mean square error and coverage of each parameter."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import norm

from benchmarks.fit.loop import BONE_NAMES
from simharness.scenario.sections.detector_section import KINDS

FACE = KINDS[:3]


def tables(draws: Sequence[Mapping[str, Any]], *, limbs: bool = True) -> Iterator[str]:
    """Yield the lines of the tables of each condition."""
    conditions = defaultdict(list)
    for each in draws:
        conditions[each["cameras"], each["annotated"]].append(each)
    for (cameras, annotated), chosen in sorted(conditions.items()):
        yield f"\n{cameras} cameras, {'annotated' if annotated else 'exact truth'}: {len(chosen)} draws"
        yield from _parameters(chosen)
        yield from _annotation(chosen)
        yield from _bones(chosen)


def inside(values: Mapping[str, float], *, level: float = 0.95) -> float:
    """Return whether the interval of a parameter holds the truth, 0 or 1; NaN without an interval.

    Intervals of another level than 95 % have the deviations of the stated one, on a logarithmic scale where it is
    above 0.
    """
    low, fitted, high = values["low"], values["fitted"], values["high"]
    if not (np.isfinite(low) and np.isfinite(high)):
        return np.nan
    share = norm.ppf((1 + level) / 2) / norm.ppf(0.975)
    if min(low, fitted) > 0:  # profiles round tiny values to 0
        low, high = (fitted * (end / fitted) ** share for end in (low, high))
    else:
        low, high = (fitted + share * (end - fitted) for end in (low, high))
    return float(low - 1e-9 <= values["true"] <= high + 1e-9)


def _parameters(draws: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    groups: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for each in draws:
        for key, values in each["values"].items():
            start, _, kind = key.rpartition(".")
            if kind in FACE or key.startswith("keypoints.face"):
                continue
            group = start if kind in KINDS or kind.isdigit() else key
            groups[group][kind].append(values)
    yield (
        f"{'parameter':34s} {'true':>7s} {'raw':>7s} {'fit':>7s} {'bias':>8s} {'rms':>7s} "
        f"{'in 95':>6s} {'in 90':>6s} {'prior':>6s}"
    )
    covered: list[tuple[float, ...]] = []
    for group, kinds in groups.items():
        rows = [
            (
                np.mean([v["true"] for v in values]),
                np.mean([v["measured"] for v in values]),
                np.mean([v["fitted"] for v in values]),
                np.mean([v["fitted"] - v["true"] for v in values]),
                np.sqrt(np.mean([(v["fitted"] - v["true"]) ** 2 for v in values])),
                np.nanmean([inside(v) for v in values]),
                np.nanmean([inside(v, level=0.9) for v in values]),
                np.mean([v["prior"] for v in values]),
            )
            for values in kinds.values()
        ]
        covered += [(float(row[-3]), float(row[-2])) for row in rows]
        mean = np.array(rows, float).mean(axis=0)
        line = f"{group:34s} {mean[0]:7.3f} {mean[1]:7.3f} {mean[2]:7.3f} {mean[3]:+8.4f} {mean[4]:7.4f} "
        yield line + " ".join(f"{each:6.0%}" for each in mean[5:])
    both = np.nanmean(np.array(covered, float), axis=0)
    yield f"{'all, mean over parameters':34s} {'':40s} " + " ".join(f"{each:6.0%}" for each in both)


def _annotation(draws: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    true, found = (np.concatenate([np.array(each["annotation"]["deviation"][k])[:, :12].ravel() for each in draws])
                   for k in (0, 1))  # fmt: skip
    away = found - true
    yield (
        f"annotation, mm: random part {1000 * true.mean():.1f}, fitted {1000 * found.mean():.1f}, "
        f"bias {1000 * away.mean():+.1f}, rms {1000 * np.sqrt((away**2).mean()):.1f}, "
        f"zeros {np.mean(found < 1e-3):.0%}"
    )
    for key in ("life", "noise"):
        pairs = np.array([each["annotation"][key] for each in draws])
        yield f"annotation, {key}: {pairs[:, 0].mean():.2f}, fitted {pairs[:, 1].mean():.2f}"


def _bones(draws: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for key in ("bones", "truth bones"):
        first, second = np.array([each[key] for each in draws]).swapaxes(0, 1)
        by_name = {name: [index for index, each in enumerate(BONE_NAMES) if each == name] for name in BONE_NAMES}
        for name, rows in by_name.items():
            one, other = first[:, rows].mean(), second[:, rows].mean()
            ratio = other / max(one, 1e-9)
            yield f"{key}, {name}: {1000 * one:.1f} mm, of the twin {1000 * other:.1f}, ratio {ratio:.2f}"
