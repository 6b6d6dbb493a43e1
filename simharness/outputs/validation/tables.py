"""Tables of the page of a validation: rows of text."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simharness.outputs import texts_of
from simharness.reality.validation.corrected_forecast import CorrectionStudy
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.twin_distance import TwinDistance
from simharness.reality.validation.validation import Validation
from simharness.reality.validation.verdicts import BOUNDS, GROUPS, BoundVerdict, VerdictState
from simharness.runtime.number_text import NOTHING, fixed, signed, span
from simharness.scoring.frame_scores import RULES

PUBLISHED = tuple(rule for rule in RULES if not rule.filled)
"""Rules for the head as published."""

_SHARES = ("recall", "detected", "missing", "gross")
# Digits and factor by group of verdicts: shares are shown in percent.
_FORMATS: Mapping[str, tuple[int, float, str]] = {
    **dict.fromkeys(("mpjpe", "bones", "epipolar", "offset", "annotation"), (1, 1.0, "mm")),
    **dict.fromkeys(("subset_rank", "draw_rank", "ghosts", "memory", "residual"), (2, 1.0, "")),
    **dict.fromkeys(("tree", "ears", "behind", "ambiguous", *_SHARES), (1, 100.0, "%")),
}
_PERCENT_BOUND = {"tree", "ears", "behind", *_SHARES}  # groups whose bounds are shares


@dataclass(frozen=True)
class Row:
    """Row of a table of verdicts."""

    title: str
    """First cell."""
    cells: tuple[tuple[str, str], ...]
    """Further cells, each with its small print."""
    state: str
    """State of the verdict."""
    note: str = ""
    """Small text under the title."""
    count: int = 1
    """Number of figures that the row stands for."""


GROUP_COLUMNS = ("hold", "cannot tell", "fail", "real", "simulated", "difference", "bound")
"""Titles of the cells of :func:`group_rows`."""


def group_rows(verdicts: Sequence[BoundVerdict]) -> list[Row]:
    """Return a row for each group: number of figures by state, and the figure that is worst."""
    rows = []
    for key, title in GROUPS.items():
        of = [each for each in verdicts if each.group == key]
        if not of:
            continue
        worst = max(of, key=_badness)
        counts = [sum(each.state == state for each in of) for state in VerdictState]
        cells = (*((str(count), "") for count in counts), *_numbers(worst))
        note = "" if len(of) == 1 else f"worst: {_label(worst)}"
        rows.append(Row(title, cells, worst.state.value, note, len(of)))
    return rows


def verdict_rows(verdicts: Sequence[BoundVerdict]) -> Iterator[tuple[str, list[Row]]]:
    """Yield the title of each group, and the rows of all of its figures."""
    for key, title in GROUPS.items():
        of = [each for each in verdicts if each.group == key]
        if of:
            yield title, [Row(_label(each), _numbers(each), each.state.value) for each in of]


def _badness(verdict: BoundVerdict) -> tuple[int, float]:
    unsigned = verdict.twin if verdict.group == "subset_mean" else -verdict.twin
    apart = abs(verdict.difference) if np.isfinite(verdict.difference) else unsigned
    return list(VerdictState).index(verdict.state), apart


def _label(verdict: BoundVerdict) -> str:
    """Return the name of a figure within its group."""
    _, _, rest = verdict.name.partition(".")
    text = re.sub(r"\.(?!\d)|(?<!\d)\.(?=\d)|(?<=\d)\.(?=\D)", ", ", rest)
    return text.replace("tree.", "") or verdict.name


def _numbers(verdict: BoundVerdict) -> tuple[tuple[str, str], ...]:
    """Return the cells real, simulated, difference and bound; the small print is the interval that is tested."""
    digits, factor, unit = _FORMATS.get(verdict.group, (1, 1.0, ""))
    after = f" {unit}" if unit else ""
    ends = span(factor * verdict.low, factor * verdict.high, digits)
    if not np.isfinite(verdict.real):
        return (NOTHING, ""), (fixed(verdict.twin, digits), ends), (NOTHING, ""), (verdict.bound, "")
    real, twin = (fixed(factor * value, digits) + after for value in (verdict.real, verdict.twin))
    if verdict.group == "order":  # the interval is that of the twins
        return (real, ""), (twin, ends), (NOTHING, ""), (verdict.bound, "")
    bound = verdict.bound
    if verdict.group in _PERCENT_BOUND:
        bound = f"± {100 * float(bound.removeprefix('± ')):g} %"
    return (real, ""), (twin, ""), (signed(factor * verdict.difference, digits), ends), (bound, "")


def cells(figure: Compared, digits: int, factor: float) -> tuple[tuple[str, str], ...]:
    """Return real, simulated and difference times ``factor`` with so many decimals, each with its interval."""
    down, up = figure.uncertainty
    ends = (figure.difference - down, figure.difference + up)
    difference = signed(factor * figure.difference, digits) if np.isfinite(figure.difference) else NOTHING
    small = span(factor * ends[0], factor * ends[1], digits) if np.isfinite(figure.real.low) else ""
    return figure.real.texts(digits, factor), figure.twin.texts(digits, factor), (difference, small)


SKILL_GROUPS: Mapping[str, str] = {"losses": "losses by added errors", "subsets": "PCP with fewer cameras"}
"""Titles of the groups of conditions of :func:`~simharness.reality.validation.skill.forecast_groups`."""


def cancelling_parts(validation: Validation) -> list[str]:
    """Return sentences on parts of the body whose errors cancel in the PCP of a variant.

    Parts cancel where one is too high by more than the bound and another too low by more than half of it.
    """
    sentences = []
    for name, groups in validation.whole.parts.items():
        apart = {key.replace("_", " "): each.difference for key, each in groups.items() if np.isfinite(each.difference)}
        high, low = max(apart, key=apart.__getitem__, default=""), min(apart, key=apart.__getitem__, default="")
        if high and max(apart[high], -apart[low]) > BOUNDS.parts and min(apart[high], -apart[low]) > BOUNDS.parts / 2:
            total = signed(validation.whole.variants[name]["pcp"][PUBLISHED[0]].difference, 1)
            sentences.append(
                f"{name}: {high} {signed(apart[high], 1)}, {low} {signed(apart[low], 1)}, which the PCP of the whole "
                f"body ({total}) does not show"
            )
    return sentences


def correction_sentence(study: CorrectionStudy) -> str:
    """Return what a few labelled frames make of the forecasts."""
    errors = {key: fixed(each, 1) for key, each in study.errors.items()}
    return (
        f"with {study.labelled} labelled frames of {study.frames}, forecasts are off by {errors['corrected']} points "
        f"(twins alone {errors['simulated']}, these frames alone {errors['labelled']}), and intervals are "
        f"{fixed(study.width, 2)} times as wide as those of these frames alone; {100 * study.coverage:.0f} % of them "
        "hold the mean over all frames (90 % stated)"
    )


def distance_sentence(distance: TwinDistance) -> str:
    """Return whether the recording can be told from its twins."""
    if not np.isfinite(distance.p_value):
        return "too few twins to say whether the recording can be told from them"
    chance = "p < 0.001" if distance.p_value < 0.001 else f"p = {distance.p_value:.3f}"
    times = f"{distance.value / distance.usual:.1f} times as far from the twins as they are from each other"
    verb = "can be told" if distance.noticed else "cannot be told"
    return f"the recording {verb} from its twins: {times} over {distance.figures} figures ({chance})"


def level_text(kind: str, level: float) -> str:
    """Return a level of a treatment with its unit."""
    unit = KINDS[kind].unit
    return f"{100 * level:g} %" if unit == "share" else f"{level:g} {unit}"


def measurement_title(key: str) -> str:
    """Return the title of a measurement: that of ``data/measurements.toml``, or one by its group."""
    titles = texts_of("measurements")
    if key in titles:
        return titles[key]
    group, _, name = key.partition(".")
    if f"{group}.*" in titles:
        return titles[f"{group}.*"].replace("*", name)
    if group == "tree":
        child, _, parent = name.partition("|")
        return f"{child} missing where the {parent} is, %"
    return f"{name} not reported, %"
