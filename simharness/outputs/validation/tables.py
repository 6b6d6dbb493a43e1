"""Tables of the page of a validation: rows of text."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from mvpose.files.input_files import parse_toml
from simharness.reality.validation.corrected_forecast import CorrectionStudy
from simharness.reality.validation.evidence import Compared
from simharness.reality.validation.treatments import KINDS
from simharness.reality.validation.twin_distance import TwinDistance
from simharness.reality.validation.validation import Validation
from simharness.reality.validation.verdicts import BOUNDS, GROUPS, BoundVerdict, VerdictState
from simharness.runtime.number_text import fixed, signed
from simharness.scoring.frame_scores import RULES
from simharness.statistics.intervals import Interval

NOTHING = "–"
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
    ends = _span(factor * verdict.low, factor * verdict.high, digits)
    if not np.isfinite(verdict.real):
        return (NOTHING, ""), (fixed(verdict.twin, digits), ends), (NOTHING, ""), (verdict.bound, "")
    real, twin = (fixed(factor * value, digits) + after for value in (verdict.real, verdict.twin))
    if verdict.group == "order":  # the interval is that of the twins
        return (real, ""), (twin, ends), (NOTHING, ""), (verdict.bound, "")
    bound = verdict.bound
    if verdict.group in _PERCENT_BOUND:
        bound = f"± {100 * float(bound.removeprefix('± ')):g} %"
    return (real, ""), (twin, ""), (signed(factor * verdict.difference, digits), ends), (bound, "")


@dataclass(frozen=True)
class ComparedCells:
    """Cells of a comparison: real, simulated, difference, each with its interval in small print."""

    real: tuple[str, str]
    twin: tuple[str, str]
    difference: tuple[str, str]


def cells(figure: Compared, digits: int, *, factor: float = 1.0) -> ComparedCells:
    """Return the cells of a comparison, numbers times ``factor`` with so many decimals."""
    down, up = figure.uncertainty
    difference = figure.difference
    ends = (difference - down, difference + up)
    return ComparedCells(
        _with_interval(figure.real, digits, factor),
        _with_interval(figure.twin, digits, factor),
        (
            signed(factor * difference, digits) if np.isfinite(difference) else NOTHING,
            _span(factor * ends[0], factor * ends[1], digits) if np.isfinite(figure.real.low) else "",
        ),
    )


def _with_interval(value: Interval, digits: int, factor: float) -> tuple[str, str]:
    if not np.isfinite(value.mean):
        return NOTHING, ""
    return fixed(factor * value.mean, digits), _span(factor * value.low, factor * value.high, digits)


def _span(low: float, high: float, digits: int) -> str:
    return f"{fixed(low, digits)} to {fixed(high, digits)}" if np.isfinite(low) and np.isfinite(high) else ""


def variant_rows(validation: Validation) -> list[tuple[str, list[ComparedCells]]]:
    """Return a row for each variant: PCP by both head rules, and MPJPE."""
    return [
        (name, [*(cells(scores["pcp"][rule], 1) for rule in PUBLISHED), cells(scores["mpjpe_mm"][PUBLISHED[0]], 1)])
        for name, scores in validation.whole.variants.items()
    ]


def people_rows(validation: Validation) -> list[tuple[str, list[ComparedCells]]]:
    """Return a row for each variant: ghosts per frame, recall and precision."""
    first = PUBLISHED[0]
    return [
        (
            name,
            [
                cells(scores["ghosts_per_frame"][first], 2),
                *(cells(scores[key][first], 1, factor=100.0) for key in ("recall", "precision")),
            ],
        )
        for name, scores in validation.whole.variants.items()
    ]


def contrast_rows(validation: Validation) -> list[tuple[str, list[ComparedCells]]]:
    """Return a row for each pair of variants: the difference of PCP by every rule for the head."""
    return [
        (f"{one} − {other}", [cells(figures[rule], 1) for rule in (*PUBLISHED, RULES[2])])
        for (one, other), figures in validation.whole.contrasts.items()
    ]


def subset_rows(validation: Validation) -> Iterator[tuple[str, list[tuple[str, ComparedCells]]]]:
    """Yield the PCP of each variant, and ``full`` minus ``fast``, by number of cameras."""
    subsets = validation.subsets
    for name in validation.plan.variants:
        yield name, [(f"{count} cameras", cells(curve[name], 1)) for count, curve in subsets.curves.items()]
    if subsets.gains:
        yield "full − fast", [(f"{count} cameras", cells(gain, 1)) for count, gain in subsets.gains.items()]


def response_rows(validation: Validation) -> Iterator[tuple[str, list[tuple[str, ComparedCells]]]]:
    """Yield the loss of PCP of each variant, by treatment and level."""
    groups: dict[str, list[tuple[str, ComparedCells]]] = {}
    for each in validation.responses:
        title = f"{KINDS[each.kind].title}, {level_text(each.kind, each.level)}"
        groups.setdefault(title, []).append((each.variant, cells(each.loss, 1)))
    yield from groups.items()


SKILL_GROUPS: Mapping[str, str] = {"losses": "losses by added errors", "subsets": "PCP with fewer cameras"}
"""Titles of the groups of conditions of :func:`~simharness.reality.validation.skill.forecast_groups`."""


@dataclass(frozen=True)
class SkillRow:
    """Row of a table of skill."""

    title: str
    """Conditions and variant."""
    conditions: int
    """Number of conditions."""
    error: tuple[str, str]
    """Mean absolute difference of the twins, points, and its interval."""
    rivals: tuple[tuple[tuple[str, str], tuple[str, str]], ...]
    """Error of each rival, and skill against it, with intervals."""


def skill_rows(validation: Validation) -> tuple[list[str], list[SkillRow]]:
    """Return the names of the rivals, and a row for each group of conditions and variant."""
    names = list(dict.fromkeys(rival for each in validation.skills for rival in each.rivals))
    nothing = (NOTHING, "")
    rows = []
    for each in validation.skills:
        rivals = [
            (_with_interval(each.rivals[name][0], 1, 1.0), _with_interval(each.rivals[name][1], 2, 1.0))
            if name in each.rivals
            else (nothing, nothing)
            for name in names
        ]
        title = f"{SKILL_GROUPS[each.what]}, {each.variant}"
        rows.append(SkillRow(title, each.conditions, _with_interval(each.error, 1, 1.0), tuple(rivals)))
    return names, rows


def agreement_rows(validation: Validation) -> list[tuple[str, int, list[tuple[str, str]]]]:
    """Return variant, number of conditions, and the correlations and the rank violation with intervals."""
    return [
        (
            each.variant,
            each.conditions,
            [
                *(_with_interval(value, 3, 1.0) for value in (each.pearson, each.spearman)),
                _with_interval(each.rank_violation, 1, 1.0),
            ],
        )
        for each in validation.agreements
    ]


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


def measurement_rows(validation: Validation) -> list[tuple[str, ComparedCells]]:
    """Return a row for each measurement of the detections that the recording has."""
    rows = []
    for key, figure in validation.whole.measured.items():
        if np.isfinite(figure.real.mean):
            title = measurement_title(key)
            percent = title.endswith(", %")
            digits = 2 if key.startswith(("score", "phantoms", "others", "residual", "memory")) else 1
            rows.append((title, cells(figure, digits, factor=100.0 if percent else 1.0)))
    return rows


@cache
def _titles() -> Mapping[str, str]:
    """Return the titles of measurements by key; the others are named by :func:`measurement_title`."""
    return parse_toml((Path(__file__).parents[1] / "data" / "measurements.toml").read_text(encoding="utf-8"))


def measurement_title(key: str) -> str:
    """Return the title of a measurement."""
    titles = _titles()
    if key in titles:
        return titles[key]
    group, _, name = key.partition(".")
    if f"{group}.*" in titles:
        return titles[f"{group}.*"].replace("*", name)
    if group == "tree":
        child, _, parent = name.partition("|")
        return f"{child} missing where the {parent} is, %"
    return f"{name} not reported, %"
