"""Detector profiles: the presets of [detector], ``scenarios/detectors/*.toml``."""

from __future__ import annotations

import json
from pathlib import Path

from simharness.scenario.presets import PROFILES, file_of, read_preset
from simharness.scenario.sections.detector import Detector

SHIPPED = PROFILES.shipped
"""Where the profiles are that come with the project."""


def read_profile(name: str, *, folder: Path | None = None) -> Detector:
    """Read a profile.

    Args:
        name: of one that comes with the project ("typical"), or a TOML file's, relative to ``folder``.
        folder: where profiles are looked for first.

    Raises:
        ScenarioError: there is none, or it says something that a detector has not.
    """
    folder = folder or Path()
    settings = read_preset(PROFILES, file_of(PROFILES, name, [folder], near=folder))
    return Detector.model_validate_json(json.dumps(settings), strict=True)
