"""Loading of a single scenario: a TOML file in, a validated :class:`Scenario` out."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path

from simharness.runtime.version import code_version
from simharness.scenario.resolution import read_plan
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import ScenarioError


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


def fingerprint(scenario: Scenario) -> str:
    """Return ten hexadecimal digits that depend on all values of a scenario, its files and the version of the code."""
    resolved = json.dumps({"code": code_version(), "scenario": scenario.model_dump(mode="json")}, sort_keys=True)
    digest = hashlib.blake2b(resolved.encode(), digest_size=5)
    for file in (*scenario.files, *scenario.method.estimators.files):
        digest.update(file.read_bytes() if os.path.isfile(file) else b"")
    return digest.hexdigest()
