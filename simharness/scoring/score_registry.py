"""Registry of scores that are computed from a recording, its estimates and the paired joints.

How to add a score:

1. Write one module in ``simharness/scoring`` with a function of :class:`ScoreInput`, decorated with :func:`score`::

       @score(ScoreInfo("ankle_mm", "Ankle height", "mm", "mean error of the height of ankles", "lower", 1))
       def ankle_height(given: ScoreInput) -> float | None: ...

2. Add the name of the module to :data:`MODULES`.

Several scores that share work are registered together: ``@scores(info, info, ...)`` on a function that returns their
values by key.

Tables of studies, thresholds of ``simharness report`` and :func:`simharness.api.assert_robust` take all scores from
:data:`simharness.scoring.catalogue.SCORES`, which contains the registered ones. A score that does not apply is None,
never zero. Keys end in ``_mm``, ``_px`` or ``_ms`` where that is the unit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.files.input_files import parse_toml

if TYPE_CHECKING:
    from mvpose import Estimate
    from simharness.types.recording import Recording

MODULES = ("joint_errors", "tracking.identity_figures")
"""Modules of ``simharness.scoring`` that register scores, in the order of the columns of tables."""

Better = Literal["higher", "lower"]


@dataclass(frozen=True)
class ScoreInfo:
    """Description of a score."""

    key: str
    """Name of its column in tables."""
    title: str
    """Short name for headings."""
    unit: str
    """Unit; empty for none."""
    about: str
    """Explanation in one line."""
    better: Better
    """Direction of better values."""
    digits: int
    """Digits after the decimal point."""
    target: float | None = None
    """Best value where neither the greatest nor the least is best: ``better`` is the direction towards it from the
    usual side, and values beyond it are worse again."""
    tolerance: float | None = None
    """Largest loss of its mean that a gate does not call a regression by default, in its unit; None: no gate compares
    it."""


@cache
def shipped_scores(table: str = "recordings") -> dict[str, ScoreInfo]:
    """Return the scores of a table of ``data/scores.toml`` by key; by default those that shipped modules register."""
    tables = parse_toml((Path(__file__).parent / "data" / "scores.toml").read_text(encoding="utf-8"))
    usual = {"unit": "%", "better": "higher", "digits": 1}
    return {key: ScoreInfo(key, **(usual | entry)) for key, entry in tables[table].items()}


@dataclass(frozen=True)
class ScoreInput:
    """Input of a registered score."""

    recording: "Recording"
    """T frames, with the truth of P people."""
    estimates: "tuple[Estimate, ...]"
    """Estimates of the variant, T."""
    truth: Floats
    """True joints, (T, P, 17, 3), metres."""
    paired: Floats
    """Joints of the estimate that is paired with each true person, (T, P, 17, 3), metres; NaN where the person is
    missed or the joint was not placed."""
    partner: Integers
    """Index of that estimate, (T, P); -1 where the person is missed."""


ScoreFunction = Callable[[ScoreInput], float | None]
GroupFunction = Callable[[ScoreInput], Mapping[str, float | None]]


@dataclass(frozen=True)
class ScoreGroup:
    """Scores that one function computes."""

    infos: tuple[ScoreInfo, ...]
    """Their descriptions."""
    compute: GroupFunction
    """Function that returns their values by key; it may return more."""
    module: str
    """Name of the module that registers them."""


_registered: dict[str, ScoreGroup] = {}  # by the key of the first score


def score(info: ScoreInfo) -> Callable[[ScoreFunction], ScoreFunction]:
    """Register the decorated function as a score.

    Raises:
        ValueError: the key is registered already.
    """

    def register(function: ScoreFunction) -> ScoreFunction:
        _register((info,), lambda given: {info.key: function(given)}, function.__module__)
        return function

    return register


def scores(*infos: ScoreInfo) -> Callable[[GroupFunction], GroupFunction]:
    """Register the decorated function as several scores: it returns the value of each by key.

    Raises:
        ValueError: a key is registered already.
    """

    def register(function: GroupFunction) -> GroupFunction:
        _register(infos, function, function.__module__)
        return function

    return register


def _register(infos: tuple[ScoreInfo, ...], compute: GroupFunction, module: str) -> None:
    known = {info.key for group in _registered.values() for info in group.infos}
    for info in infos:
        if info.key in known:
            raise ValueError(f"the score {info.key!r} is registered twice: choose another key for one of them")
        known.add(info.key)
    _registered[infos[0].key] = ScoreGroup(infos, compute, module)


@cache
def registered_scores() -> tuple[ScoreGroup, ...]:
    """Return all registered scores, in the order of :data:`MODULES`."""
    modules = [import_module(f"simharness.scoring.{module}").__name__ for module in MODULES]
    return tuple(sorted(_registered.values(), key=lambda group: modules.index(group.module)))


def compute_scores(given: ScoreInput) -> dict[str, float | None]:
    """Return all registered scores by key, in the order of the columns of tables."""
    found: dict[str, float | None] = {}
    for group in registered_scores():
        values = group.compute(given)
        found |= {info.key: values[info.key] for info in group.infos}
    return found


def statistic(function: Callable[[Floats], np.floating], values: Floats) -> float | None:
    """Return a statistic of the finite values; None without any."""
    values = values[np.isfinite(values)]
    return float(function(values)) if len(values) else None


def finite_mean(values: Floats) -> float | None:
    """Return the mean of the finite values; None without any."""
    return statistic(np.mean, values)


def in_percent(share: float | None) -> float | None:
    """Return a share in percent; None without one."""
    return None if share is None else 100.0 * share
