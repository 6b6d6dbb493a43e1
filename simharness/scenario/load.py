"""Scenario files: TOML in, a checked :class:`Scenario` out, one clear message for each mistake."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

from simharness.runtime.version import code_version
from simharness.scenario.resolution import read_plan
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_reader import ScenarioError


def load(
    path: Path | str, *, overrides: Sequence[str] = (), seed: int | None = None, folder: Path | None = None
) -> Scenario:
    """Read a scenario file.

    Args:
        path: a TOML file; what its keys mean is written in :mod:`simharness.scenario.sections.scenario`. It begins
            with the file that it extends, its cameras with the rig and its detector with the profile that they name.
        overrides: ``"people.count=6"``: a dotted key and a TOML value that replaces the file's; a value that
            is not TOML is taken as a bare word, so ``rendering.renderer=gl`` needs no quotes.
        seed: replaces the scenario's seed.
        folder: what files that the scenario file names are relative to; by default its own.

    Raises:
        ScenarioError: a file that is missing or not TOML, a key that does not exist (the nearest one is
            named), or a value of the wrong type or out of range, all named at once; or a file that makes more than
            one scenario, a study.
    """
    plan = read_plan(path, overrides=overrides, seed=seed, folder=folder)
    if plan.is_study:
        raise ScenarioError(
            f"{path}: is a study, not one scenario: it makes {plan.trials:,} trials ({plan.settings:,} x "
            f"{len(plan.seeds):,}, settings x seeds); run it with simharness study {path}"
        )
    return plan.base


def fingerprint(scenario: Scenario) -> str:
    """Ten hexadecimal digits that change with any value of the scenario, its files and the version of the code."""
    resolved = json.dumps({"code": code_version(), "scenario": scenario.model_dump(mode="json")}, sort_keys=True)
    digest = hashlib.blake2b(resolved.encode(), digest_size=5)
    for file in (*scenario.files, *scenario.method.estimators.files):
        digest.update(file.read_bytes() if file.is_file() else b"")
    return digest.hexdigest()
