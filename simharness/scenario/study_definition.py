"""Studies: a scenario file with a sweep, cases, seeds and variants, and the settings that they make.

A scenario file may say, beside the keys of a scenario::

    extends = "quickstart.toml"       # a base, relative to this file; what is said here goes over it, key by key
    seeds = 20                        # how many, from the scenario's seed on, or a list of seeds
    variants = ["full", "fast"]       # the same as method.variants

    [sweep]                           # keys of a scenario, each with values: every combination of them
    cameras.count = [2, 3, 5, 8]
    detector.phantoms.rate = { from = 0.0, to = 2.0, steps = 5 }        # scale = "log" for a geometric range
    detector.profile = ["poor", "typical"]
    one_at_a_time = true              # instead: the base, and every key by itself

    [[sweep.paired]]                  # values that go together, in turn
    cameras.count = [3, 5]
    cameras.radius = [3.0, 4.0]

    [cases.crowd]                     # named changes, each run with every setting of the sweep
    people.count = 8

    [method.estimators]               # methods of one's own, for variants to name: simharness.trial.stages.estimators
    mine = "mine.py:Mine"

    [gate]                            # simharness.scenario.sections.gate

A setting at a seed is a trial; all variants of a trial see the same detections. A file that says none of this is a
study of one trial.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from simharness.scenario.resolution import Plan, Resolver, read_plan, refuse, value_at, vary
from simharness.scenario.sections.gate import Gate
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sweep import Value
from simharness.scenario.toml_reader import ScenarioError
from simharness.scenario.validation_messages import place_of

__all__ = ["LIMIT", "Setting", "Study", "StudyTooLarge", "Value", "load_study"]

LIMIT = 10_000
"""The most trials of a study that nobody has said yes to."""


class StudyTooLarge(ScenarioError):
    """A study of more trials than anybody is likely to mean."""


@dataclass(frozen=True)
class Setting:
    """One combination of factors.

    Attributes:
        case: name of the case; "" where the file has none.
        varied: where keys are swept one at a time, the dotted key that this setting varies, the first of those that go
            together; "" for the base, and for combinations.
        factors: every swept dotted key and its value here, the base's where it is not varied. None: there is no value,
            or joints have different ones.
        scenario: resolved; its seed is the study's first, its variants are the study's.
    """

    case: str
    varied: str
    factors: Mapping[str, Value]
    scenario: Scenario


@dataclass(frozen=True)
class Study:
    """What a scenario file is run for.

    Attributes:
        name: of the scenario.
        description: of the scenario.
        seeds: of every setting.
        variants: of the method, in every trial.
        factors: dotted keys that are swept, in the file's order.
        one_at_a_time: every factor by itself, beside the base.
        settings: case by case, the last factor first.
        gate: section [gate].
        path: of the file.
        base: the scenario without sweep and cases, at the first seed.
        said: the keys of the file, of what it extends and of the command line, before presets and sweep are resolved.
    """

    name: str
    description: str
    seeds: tuple[int, ...]
    variants: tuple[str, ...]
    factors: tuple[str, ...]
    one_at_a_time: bool
    settings: tuple[Setting, ...]
    gate: Gate
    path: Path
    base: Scenario
    said: Mapping[str, Any] = field(default_factory=dict)

    @property
    def trials(self) -> int:
        """How many trials there are: settings times seeds."""
        return len(self.settings) * len(self.seeds)

    def at(self, setting: Setting, seed: int) -> Scenario:
        """The scenario of a trial."""
        return setting.scenario.model_copy(update={"seed": seed})


def load_study(
    path: Path | str,
    *,
    overrides: Sequence[str] = (),
    seeds: int | Sequence[int] | None = None,
    variants: Sequence[str] | None = None,
    limit: int | None = LIMIT,
    folder: Path | None = None,
) -> Study:
    """Read a scenario file as a study; every setting is resolved and checked.

    Args:
        path: a TOML file.
        overrides: as of :func:`simharness.scenario.load.load`: ``"sweep.cameras.count=[2, 3]"`` is one, too.
        seeds: replaces the file's seeds: how many, or which.
        variants: replaces the file's variants.
        limit: the most trials; None: any number.
        folder: what files that the scenario file names are relative to; by default its own.

    Raises:
        StudyTooLarge: there would be more trials than ``limit``; none was made.
        ScenarioError: as :func:`simharness.scenario.load.load`. All mistakes of a study are named at once.
    """
    plan = read_plan(path, overrides=overrides, seeds=seeds, variants=variants, folder=folder)
    _check_variants(plan)
    if limit is not None and plan.trials > limit:
        raise StudyTooLarge(
            f"{path}: makes {plan.trials:,} trials ({plan.settings:,} x {len(plan.seeds):,}, settings x seeds), more "
            f"than {limit:,}: sweep over fewer values, or add --yes if you mean it"
        )
    return Study(
        name=plan.base.name,
        description=plan.base.description,
        seeds=tuple(plan.seeds),
        variants=plan.base.method.variants,
        factors=plan.sweep.keys,
        one_at_a_time=plan.sweep.one_at_a_time,
        settings=tuple(_settings(plan)),
        gate=plan.gate,
        path=Path(path),
        base=plan.base,
        said=plan.document.data,
    )


def _settings(plan: Plan) -> Iterator[Setting]:
    """Every setting; when all were made, what is wrong with them is raised."""
    mistakes: list[str] = []
    resolver = Resolver(plan.document, mistakes)
    for case in plan.cases:
        for varied, values in plan.sweep.settings(case.values):
            data, places = vary(case.data, case.places, plan.sweep, values)
            scenario = resolver.scenario(data, places)
            if scenario is not None:
                mistakes += _blind(scenario, plan)
                yield Setting(
                    case.name, varied, {key: value_at(scenario, data, key) for key in plan.sweep.keys}, scenario
                )
    refuse(mistakes)


def _check_variants(plan: Plan) -> None:
    from simharness.scenario.sections.variants import wrong_variants

    for key, said in wrong_variants(plan.base.method):
        place = place_of(("method", *key.split(".")), plan.document.places, str(plan.document.path))
        raise ScenarioError(f"{place}: {key if key == 'variants' else f'method.{key}'}: {said}")


def _blind(scenario: Scenario, plan: Plan) -> list[str]:
    """What to say of variants that have nothing to go by in a scenario."""
    from mvpose.pipeline import NEED_DESCRIPTORS

    blind = NEED_DESCRIPTORS & set(scenario.method.variants)
    if not blind or scenario.appearance.source != "none":
        return []
    return [
        f"{_place_of_variants(plan)}: variants: {', '.join(blind)} goes by descriptors, and detections have none; "
        'choose appearance.source = "pictures" or "drawn", or another variant'
    ]


def _place_of_variants(plan: Plan) -> str:
    return place_of(("method", "variants"), plan.document.places, str(plan.document.path))
