"""Loading of scenario files: a single :class:`Scenario`, or a :class:`Study` with all its settings.

A file is read in steps, each in a module of its own: :mod:`.document` reads it (:mod:`.toml_files`) and the files that
it extends, :mod:`.sweep` takes sweep, cases and seeds out of it and makes the keys of each setting, :mod:`.presets`
puts rigs, sensor and detector profiles under them, and :mod:`.checks` validates the result.

Beside the keys of a scenario, a scenario file may have::

    extends = "quickstart"            # a base: a shipped scenario, or a file relative to this one
    seeds = 20                        # their number, from the scenario's seed on, or a list of seeds
    variants = ["full", "fast"]       # the same as method.variants

    [sweep]                           # keys of a scenario, each with values: all combinations
    cameras.count = [2, 3, 5, 8]
    detector.phantoms.rate = { from = 0.0, to = 2.0, steps = 5 }        # scale = "log" for a geometric range
    detector.profile = ["poor", "typical"]
    one_at_a_time = true              # instead: the base, and each key alone
    pairwise = true                   # instead: few combinations, with every pair of values of two keys
    refine = 3                        # a run adds up to three values to each key, where scores break

    [[sweep.paired]]                  # keys that are varied together
    cameras.count = [3, 5]
    cameras.radius = [3.0, 4.0]

    [cases.crowd]                     # named changes, each run with every setting of the sweep
    people.count = 8

    [search]                          # keys that a hunt may change, written as those of [sweep]
    people.count = [2, 4, 8]

    [method.estimators]               # user-defined estimators: simharness.trial.stages.estimators
    custom = "custom.py:Custom"

    [gate]                            # simharness.scenario.sections.method_section

A setting at a seed is a trial; all variants of a trial get the same detections. A file without these keys is a study of
one trial.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from simharness.runtime.version import code_version
from simharness.scenario.checks import Checker, refuse
from simharness.scenario.document import Document, read_document
from simharness.scenario.file_model import MOST_TRIALS
from simharness.scenario.layers import Key, Origins, merge, nested, set_origin
from simharness.scenario.presets import Presets
from simharness.scenario.sections.gate_section import GateSection
from simharness.scenario.sections.method_section import wrong_variants
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sweep import Sweep, SweepReader, Value, value_at, vary
from simharness.scenario.toml_files import ScenarioError
from simharness.scenario.validation_messages import origin_of

LIMIT = 10_000
"""Largest number of trials of a study that is run without confirmation (``--yes``)."""


class StudyTooLarge(ScenarioError):
    """Study with more trials than the limit."""


@dataclass(frozen=True)
class Setting:
    """One combination of factors."""

    case: str
    """Name of the case; "" where the file has no cases."""
    varied: str
    """Where keys are swept one at a time, the dotted key that this setting varies, the first of paired keys; "" for the
    base, and for combinations."""
    factors: Mapping[str, Value]
    """Every swept dotted key and its value in this setting, that of the base where it is not varied. None: no value, or
    different values for the joints."""
    scenario: Scenario
    """Resolved scenario, with the first seed and all variants of the study."""


@dataclass(frozen=True)
class Study:
    """All trials of a scenario file."""

    name: str
    """Name of the scenario."""
    description: str
    """Description of the scenario."""
    seeds: tuple[int, ...]
    """Seeds of every setting."""
    variants: tuple[str, ...]
    """Variants of the method in every trial."""
    factors: tuple[str, ...]
    """Dotted keys that are swept, in the order of the file."""
    one_at_a_time: bool
    """Whether each factor is varied alone."""
    settings: tuple[Setting, ...]
    """Settings case by case; the last factor varies fastest."""
    gate: GateSection
    """Section [gate]."""
    path: Path
    """The file, or the name of a shipped scenario, as it was given."""
    base: Scenario
    """The scenario without sweep and cases, at the first seed."""
    data: Mapping[str, Any]
    """Keys of the file, of its bases and of the command line, before presets and sweep are resolved."""
    plan: "ScenarioPlan"
    """The file from which it was loaded."""

    @property
    def trials(self) -> int:
        """Number of trials: settings times seeds."""
        return len(self.settings) * len(self.seeds)

    def at(self, setting: Setting, seed: int) -> Scenario:
        """Return the scenario of a trial."""
        return setting.scenario.model_copy(update={"seed": seed})

    def with_values(self, added: Mapping[str, Sequence[Value]]) -> "Study":
        """Return the study with more values of swept keys; its file then has all values, and is not refined.

        Raises:
            ScenarioError: a setting is not valid.
        """
        if not added:
            return self
        plan = replace(self.plan, sweep=self.plan.sweep.with_values(added))
        data = merge(dict(self.data), {"sweep": {"refine": 0}})
        for axis in plan.sweep.axes:
            if axis.keys[0] in added:
                values = [value for (value,) in axis.values]
                data = merge(data, nested(("sweep", *axis.keys[0].split(".")), values))
        return replace(self, settings=tuple(_settings(plan)), data=data, plan=plan)


@dataclass(frozen=True)
class ScenarioCase:
    """Named change of the base; the base itself in a file without cases."""

    name: str
    """Name of the case; "" where the file has no cases."""
    data: dict[str, Any]
    """Keys of the scenario file with the changes."""
    origins: Origins
    """Origins of the keys."""
    changes: Mapping[str, Any]
    """Keys that the case changes."""
    scenario: Scenario
    """Resolved scenario."""
    values: Mapping[str, Value]
    """Values of all swept keys, dotted, where they are not varied."""


@dataclass(frozen=True)
class ScenarioPlan:
    """Resolved scenario file: the base scenario, and what is varied."""

    document: Document
    """Keys of the file and its bases."""
    base: Scenario
    """The scenario without sweep and cases; its seed is the first one."""
    seeds: Sequence[int]
    """Seeds of every setting."""
    sweep: Sweep
    """Factors and their values."""
    cases: tuple[ScenarioCase, ...]
    """At least one case."""
    gate: GateSection
    """Section [gate]."""
    search: Sweep
    """Section [search]."""

    def at(self, values: Mapping[str, Value], seed: int) -> Scenario:
        """Return the base with other values of keys of [search], at a seed.

        Raises:
            ScenarioError: the values are not valid together.
        """
        mistakes: list[str] = []
        keys = vary(self.cases[0].data, self.cases[0].origins, self.search, values)
        scenario = _Settings(self.document, mistakes).scenario(*keys)
        refuse(mistakes)
        assert scenario is not None
        return scenario.model_copy(update={"seed": seed})

    @property
    def settings(self) -> int:
        """Number of settings."""
        return sum(self.sweep.count(case.values) for case in self.cases)

    @property
    def trials(self) -> int:
        """Number of trials: settings times seeds."""
        return self.settings * len(self.seeds)

    @property
    def most_trials(self) -> int:
        """Number of trials with as many values as a run may add where scores break."""
        return sum(self.sweep.count(case.values, refined=True) for case in self.cases) * len(self.seeds)

    @property
    def is_study(self) -> bool:
        """Whether there is more than the base at one seed."""
        return bool(self.sweep.axes or self.cases[0].name or len(self.seeds) > 1)


def load(
    path: Path | str, *, overrides: Sequence[str] = (), seed: int | None = None, folder: Path | None = None
) -> Scenario:
    """Read a scenario file.

    Args:
        path: a TOML file, or the name of a shipped scenario ("quickstart"). Its keys are documented in
            :mod:`simharness.scenario.sections.scenario`; it is merged over the file that it extends, and over the rig
            and the detector profile that it names.
        overrides: ``"people.count=6"``: a dotted key and a TOML value that replaces the one of the file. A value that
            is not TOML is taken as text, so that ``rendering.renderer=gl`` needs no quotes.
        seed: replaces the scenario's seed.
        folder: folder to which files named in the scenario file are relative; by default that of the file.

    Raises:
        ScenarioError: the file does not exist or is not TOML; a key does not exist (the message names the nearest) or
            has a value of a wrong type or out of range (all are reported together); or the file is a study, with more
            than one trial.
    """
    plan = read_plan(path, overrides=overrides, seed=seed, folder=folder)
    if plan.is_study:
        raise ScenarioError(
            f"{path}: is a study, not a single scenario: it has {plan.trials:,} trials ({plan.settings:,} x "
            f"{len(plan.seeds):,}, settings x seeds); run it with simharness study {path}"
        )
    return plan.base


def load_study(
    path: Path | str,
    *,
    overrides: Sequence[str] = (),
    seeds: int | Sequence[int] | None = None,
    variants: Sequence[str] | None = None,
    limit: int | None = LIMIT,
    folder: Path | None = None,
) -> Study:
    """Read a scenario file as a study; every setting is resolved and validated.

    Args:
        path: a TOML file, or the name of a shipped scenario.
        overrides: as in :func:`simharness.scenario.load.load`; also ``"sweep.cameras.count=[2, 3]"``.
        seeds: replaces the file's seeds: their number, or a list of them.
        variants: replaces the file's variants.
        limit: largest number of trials; None: :data:`~simharness.scenario.file_model.MOST_TRIALS`.
        folder: folder to which files named in the scenario file are relative; by default that of the file.

    Raises:
        StudyTooLarge: more trials than ``limit``; no setting is made.
        ScenarioError: as :func:`simharness.scenario.load.load`. All mistakes of a study are reported together.
    """
    plan = read_plan(path, overrides=overrides, seeds=seeds, variants=variants, folder=folder)
    _check_variants(plan)
    size = f"{path}: makes {plan.trials:,} trials ({plan.settings:,} x {len(plan.seeds):,}, settings x seeds)"
    if plan.most_trials > plan.trials:
        size += f", up to {plan.most_trials:,} with the values that sweep.refine = {plan.sweep.refine} may add"
    if plan.most_trials > MOST_TRIALS:
        raise StudyTooLarge(
            f"{size}, more than the {MOST_TRIALS:,} that a study may have: sweep over fewer values, or split it into "
            "several files"
        )
    if limit is not None and plan.most_trials > limit:
        raise StudyTooLarge(f"{size}, more than {limit:,}: sweep over fewer values, or add --yes to run it")
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
        data=plan.document.data,
        plan=plan,
    )


def read_plan(
    path: Path | str,
    *,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    seeds: int | Sequence[int] | None = None,
    variants: Sequence[str] | None = None,
    folder: Path | None = None,
) -> ScenarioPlan:
    """Read and resolve a scenario file.

    Args:
        path: a TOML file, or the name of a shipped scenario.
        overrides: as in :func:`simharness.scenario.load.load`.
        seed: replaces the scenario's seed.
        seeds: replaces the study's seeds: their number, or a list of them.
        variants: replaces the variants.
        folder: folder to which files named in the scenario file are relative; by default that of the file.

    Raises:
        ScenarioError: as :func:`simharness.scenario.load.load`.
    """
    document = read_document(path, overrides=overrides, folder=folder)
    data, origins = dict(document.data), document.origins
    for key, value in (("seed", seed), ("seeds", seeds)):
        if value is not None:
            _refuse_second(origins, (key,), f"--{key}")
            data[key] = list(value) if isinstance(value, Sequence) else value
            set_origin(origins, (key,), f"--{key}")
    if variants is not None:
        _refuse_second(origins, ("method", "variants"), "--variant")
        data = merge(data, {"method": {"variants": list(variants)}})
        set_origin(origins, ("method", "variants"), "--variant")

    mistakes: list[str] = []
    reader = SweepReader(origins, str(document.path), mistakes)
    settings = _Settings(document, mistakes)
    search = reader.sweep(data.pop("search", {}), "search")
    sweep = reader.sweep(data.pop("sweep", {}))
    changes = reader.cases(data.pop("cases", {}), sweep) or {"": {}}
    gate = settings.checker.gate(data.pop("gate", {}), origins)
    all_seeds = reader.seeds(data)
    reader.check_presets(data, sweep)
    base = settings.scenario(data, origins)
    cases = []
    for name, changed in changes.items():
        keys = reader.change(data, name, changed)
        scenario = settings.scenario(*keys)
        if scenario is not None:
            values = {key: value_at(scenario, keys[0], key) for key in sweep.keys}
            cases.append(ScenarioCase(name, *keys, changed, scenario, values))
    # Those of swept values are reported as well where there are others: settings are not made after a mistake.
    for axes in (search, sweep) if mistakes else (search,):
        for axis in axes.axes:
            for axis_values in axis.values:
                settings.scenario(*vary(data, origins, axes, dict(zip(axis.keys, axis_values, strict=True))))
    refuse(mistakes)
    assert base is not None
    return ScenarioPlan(document, base, all_seeds, sweep, tuple(cases), gate, search)


def _refuse_second(origins: Origins, key: Key, option: str) -> None:
    """Refuse an option of a key that an override sets, too."""
    if (override := origins.get(key, "")).startswith("--set"):
        raise ScenarioError(f"{option}: {override} sets the same key; give one of them")


class _Settings:
    """Settings of a scenario file: keys over the presets that they name, then checked."""

    def __init__(self, document: Document, mistakes: list[str]) -> None:
        """Read settings of ``document``; append messages to ``mistakes``."""
        self.checker = Checker(str(document.path), mistakes)
        self._presets = Presets(document.folders)
        self._mistakes = mistakes

    def scenario(self, data: dict[str, Any], origins: Origins) -> Scenario | None:
        """Return the scenario of some keys; None where they are not valid."""
        try:
            resolved = self._presets.under(data, origins)
        except ScenarioError as error:
            self._mistakes.append(str(error))
            return None
        return self.checker.scenario(resolved, origins)


def _settings(plan: ScenarioPlan) -> Iterator[Setting]:
    """Yield every setting; at the end, raise the mistakes of all of them."""
    mistakes: list[str] = []
    settings = _Settings(plan.document, mistakes)
    for case in plan.cases:
        for varied, values in plan.sweep.settings(case.values):
            data, origins = vary(case.data, case.origins, plan.sweep, values)
            scenario = settings.scenario(data, origins)
            if scenario is not None:
                mistakes += _without_descriptors(scenario, plan)
                yield Setting(
                    case.name, varied, {key: value_at(scenario, data, key) for key in plan.sweep.keys}, scenario
                )
    refuse(mistakes)


def _check_variants(plan: ScenarioPlan) -> None:
    for key, message in wrong_variants(plan.base.method):
        origin = origin_of(("method", *key.split(".")), plan.document.origins, str(plan.document.path))
        raise ScenarioError(f"{origin}: {key if key == 'variants' else f'method.{key}'}: {message}")


def _without_descriptors(scenario: Scenario, plan: ScenarioPlan) -> list[str]:
    """Return a message about variants that need descriptors in a scenario without them."""
    from mvpose.presets import NEED_DESCRIPTORS, without_repair

    affected = [name for name in scenario.method.variants if without_repair(name) in NEED_DESCRIPTORS]
    if not affected or scenario.appearance.source != "none":
        return []
    origin = origin_of(("method", "variants"), plan.document.origins, str(plan.document.path))
    return [
        f"{origin}: variants: {', '.join(affected)} needs descriptors, which the detections lack; "
        'choose appearance.source = "pictures" or "drawn", or another variant'
    ]


def fingerprint(scenario: Scenario) -> str:
    """Return ten hexadecimal digits that depend on all values of a scenario, its files and the version of the code."""
    resolved = json.dumps({"code": code_version(), "scenario": scenario.model_dump(mode="json")}, sort_keys=True)
    digest = hashlib.blake2b(resolved.encode(), digest_size=5)
    for file in (*scenario.files, *scenario.method.estimators.files):
        digest.update(file.read_bytes() if os.path.isfile(file) else b"")
    return digest.hexdigest()
