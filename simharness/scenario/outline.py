"""Outline of a scenario file for people: the varied keys as comments, and the resolved base as TOML."""

import json
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from simharness.scenario.layers import leaves
from simharness.scenario.load import ScenarioPlan
from simharness.scenario.sweep import Axis
from simharness.scenario.toml_files import dumps

_WIDTH = 96  # columns of a line of values
_MOST = 12  # listed values of one factor
_LAID_OUT = ("count", "heights", "spread", "spacing", "positions", "aims", "fov", "distortion", "jitter", "aim_jitter")
_WITHOUT_EFFECT = {"file": _LAID_OUT, "preset": (*_LAID_OUT, "radius", "height", "start", "aim", "size")}


def outline(plan: ScenarioPlan, note: str = "") -> str:
    """Return the base as TOML, which :func:`simharness.scenario.load.load` reads back; above it what a study varies.

    Args:
        plan: the resolved file.
        note: additional line about a study.
    """
    lines = _lines(plan, note) if plan.is_study else []
    lines += _unused(plan)
    comments = "".join(f"# {line}".rstrip() + "\n" for line in lines)
    return f"{comments}\n{dumps(plan.base)}" if comments else dumps(plan.base)


def _unused(plan: ScenarioPlan) -> list[str]:
    """Return lines about the keys of [cameras] that have no effect on a rig of a file or a preset."""
    layout = plan.base.cameras.layout
    if layout not in _WITHOUT_EFFECT:
        return []
    size = "; cameras.size counts where the file does not state it" if layout == "file" else ""
    names = ", ".join(_WITHOUT_EFFECT[layout])
    text = f"The rig is that of cameras.{layout}. Without effect in [cameras]: {names}{size}"
    return textwrap.wrap(text, _WIDTH)


def _lines(plan: ScenarioPlan, note: str) -> list[str]:
    variants = plan.base.method.variants
    most = f" (up to {plan.most_trials:,} where scores break)" if plan.most_trials > plan.trials else ""
    lines = [
        f"{plan.base.name}: {_count(plan.settings, 'setting')} x {_count(len(plan.seeds), 'seed')} = "
        f"{_count(plan.trials, 'trial')}{most}, each by {_count(len(variants), 'variant')}",
        *([note] if note else []),
        "",
    ]
    rows = [("variants", ", ".join(variants)), ("seeds", _seeds(plan.seeds))]
    lines += _table(rows)
    if plan.sweep.axes:
        how = "the base, and one key at a time" if plan.sweep.one_at_a_time else "all combinations of"
        how = "combinations with all pairs of values of" if plan.sweep.pairwise else how
        how += (
            f", up to {_count(plan.sweep.refine, 'more value')} of each where scores break" if plan.sweep.refine else ""
        )
        lines += ["", f"sweep: {how}", *_table([row for axis in plan.sweep.axes for row in _axis(axis)])]
    if plan.cases[0].name:
        lines += ["", "cases", *_table([(case.name, _changes(case.changes)) for case in plan.cases])]
    return [*lines, "", "The base:"]


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def _seeds(seeds: Sequence[int]) -> str:
    if isinstance(seeds, range) and len(seeds) > 2:
        return f"{seeds[0]} to {seeds[-1]}"
    return _some([str(seed) for seed in seeds])


def _axis(axis: Axis) -> list[tuple[str, str]]:
    """Return a row for every key; paired keys follow the first."""
    first, *others = axis.keys
    values = [_some(list(map(_shown, column))) for column in zip(*axis.values, strict=True)]
    return list(zip([first, *(f"with {key}" for key in others)], values, strict=True))


def _changes(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{'.'.join(key)} = {_shown(value)}" for key, value in leaves(changes)) or "the base"


def _some(values: Sequence[str]) -> str:
    if len(values) <= _MOST:
        return ", ".join(values)
    return f"{', '.join(values[: _MOST - 2])}, ..., {values[-1]} ({len(values):,} values)"


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)


def _table(rows: Sequence[tuple[str, str]]) -> list[str]:
    """Return a table of two columns as lines; the second column is wrapped."""
    width = 2 + max(len(name) for name, _ in rows) + 2
    lines = []
    for name, text in rows:
        wrapped = textwrap.wrap(text, max(_WIDTH - width, 30), break_long_words=False) or [""]
        lines += [f"  {name}".ljust(width) + wrapped[0], *(" " * width + line for line in wrapped[1:])]
    return lines
