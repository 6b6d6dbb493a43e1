"""The trials of a suite: what they are called, and the command that runs one by itself, with report and pictures."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from simharness.scenario.document import read_document
from simharness.scenario.layers import leaves
from simharness.scenario.study_definition import Setting, Study
from simharness.scenario.toml_files import toml

_WORD = re.compile(r"[a-z][a-z0-9_-]*")
_VALUES = ("true", "false", "inf", "nan")  # words that TOML takes for something else
_ALONE = {"cases": "{}", "sweep": "{}", "seeds": "1"}  # what makes one scenario of a study


class TrialKey(NamedTuple):
    """One variant at one setting and seed.

    Attributes:
        case: the name of the setting, from :func:`setting_name`.
        seed: its seed.
        variant: of the method.
    """

    case: str
    seed: int
    variant: str

    def __str__(self) -> str:
        return f"{self.case}, seed {self.seed}, {self.variant}"


def settings_at_seeds(study: Study) -> Iterator[tuple[Setting, int]]:
    """Every setting at every seed."""
    for seed in study.seeds:
        for setting in study.settings:
            yield setting, seed


def setting_name(setting: Setting, study: Study) -> str:
    """What a setting is called among its like: its case and its factors; the study's name where it has neither."""
    factors = ", ".join(f"{key} = {json.dumps(value)}" for key, value in setting.factors.items())
    return ", ".join(filter(None, (setting.case, factors))) or study.name


def command_of(study: Study, trial: TrialKey) -> str:
    """``simharness run FILE --set KEY=VALUE ... --seed N``, for a shell: runs a trial by itself, with all variants.

    Raises:
        ValueError: the study has no such trial.
    """
    setting = next((each for each in study.settings if setting_name(each, study) == trial.case), None)
    if setting is None or trial.seed not in study.seeds:
        raise ValueError(f"{study.path} has no trial {trial}")
    sets = [part for override in overrides(study, setting) for part in ("--set", override)]
    return shlex.join(["simharness", "run", str(study.path), *sets, "--seed", str(trial.seed)])


def overrides(study: Study, setting: Setting) -> list[str]:
    """What to ``--set`` over a study's file to get one of its settings, and that alone."""
    said = read_document(study.path).data
    alone = {key: value for key, value in _ALONE.items() if key in said}
    changes = dict(_values(said["cases"][setting.case])) if setting.case else {}
    factors = {key: value for key, value in setting.factors.items() if value is not None}  # None: it has no one value
    written = {key: _written(value) for key, value in {**changes, **factors}.items()}
    return [f"{key}={value}" for key, value in {**alone, **written}.items()]


def _values(data: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Values by dotted key."""
    for key in leaves(data):
        value: Any = data
        for part in key:
            value = value[part]
        if not isinstance(value, Mapping):  # an empty section says nothing
            yield ".".join(key), value


def _written(value: Any) -> str:
    """A TOML value; words without the quotes that a shell would need quotes around."""
    if isinstance(value, str) and _WORD.fullmatch(value) and value not in _VALUES:
        return value
    return toml(value)
