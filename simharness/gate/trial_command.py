"""Names of the trials of a suite, and the command that runs one trial alone, with report and pictures."""

import json
import re
import shlex
from typing import Any, NamedTuple

from simharness.scenario.document import read_document
from simharness.scenario.layers import leaves
from simharness.scenario.load import Setting, Study
from simharness.scenario.toml_files import toml

_WORD = re.compile(r"[a-z][a-z0-9_-]*")
_VALUES = ("true", "false", "inf", "nan")  # words with a meaning in TOML
_ALONE = {"cases": "{}", "sweep": "{}", "seeds": "1"}  # overrides that turn a study into one scenario


class TrialKey(NamedTuple):
    """Key of one variant at one setting and seed."""

    case: str
    """Name of the setting, from :func:`setting_name`."""
    seed: int
    """Seed."""
    variant: str
    """Name of the variant."""

    def __str__(self) -> str:
        return f"{self.case}, seed {self.seed}, {self.variant}"


def setting_name(setting: Setting, study: Study) -> str:
    """Return the name of a setting: its case and its factors; the name of the study where it has neither."""
    factors = ", ".join(f"{key} = {json.dumps(value)}" for key, value in setting.factors.items())
    return ", ".join(filter(None, (setting.case, factors))) or study.name


def command_of(study: Study, trial: TrialKey) -> str:
    """Return the shell command that runs one trial alone: ``simharness run FILE --set KEY=VALUE ... --seed N``.

    Raises:
        ValueError: the study has no such trial.
    """
    setting = next((each for each in study.settings if setting_name(each, study) == trial.case), None)
    if setting is None or trial.seed not in study.seeds:
        raise ValueError(f"{study.path} has no trial {trial}")
    sets = [part for override in overrides(study, setting) for part in ("--set", override)]
    return shlex.join(["simharness", "run", str(study.path), *sets, "--seed", str(trial.seed)])


def overrides(study: Study, setting: Setting) -> list[str]:
    """Return the ``--set`` overrides of a study's file that give one of its settings alone."""
    data = read_document(study.path).data
    alone = {key: value for key, value in _ALONE.items() if key in data}
    found = leaves(data["cases"][setting.case]) if setting.case else ()
    changes = {".".join(key): value for key, value in found if value != {}}  # an empty section sets nothing
    factors = {key: value for key, value in setting.factors.items() if value is not None}  # None: no single value
    texts = {key: _toml_text(value) for key, value in {**changes, **factors}.items()}
    return [f"{key}={value}" for key, value in {**alone, **texts}.items()]


def _toml_text(value: Any) -> str:
    """Return a value as TOML; a plain word without quotes, which a shell would need quotes around."""
    if isinstance(value, str) and _WORD.fullmatch(value) and value not in _VALUES:
        return value
    return toml(value)
