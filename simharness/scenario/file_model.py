"""All that a scenario file may say: a scenario, what it begins with, and what makes a study of it.

A :class:`~simharness.scenario.sections.scenario.Scenario` is what is left when presets, bases and sweeps are resolved.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from simharness.scenario.sections.cameras import Cameras
from simharness.scenario.sections.detector import Detector
from simharness.scenario.sections.gate import Gate
from simharness.scenario.sections.scenario import Scenario

Seed = Annotated[int, Field(ge=0)]


class CamerasSection(Cameras):
    """[cameras] as a file may write it."""

    rig: str = Field("", description="the rig to begin with, of scenarios/rigs or a TOML file; other keys change it")


class DetectorSection(Detector):
    """[detector] as a file may write it."""

    profile: str = Field(
        "typical", description="the detector to begin with, of scenarios/detectors or a TOML file; other keys change it"
    )


class ScenarioFile(Scenario):
    """Keys that a scenario file may have. :mod:`simharness.scenario.resolution` gives them meaning."""

    extends: str = Field("", description="a scenario file to begin with, relative to this one; keys here go over it")
    seeds: Annotated[int, Field(ge=1)] | Annotated[tuple[Seed, ...], Field(min_length=1)] = Field(
        1, description="how many, from the scenario's on, or a list"
    )
    variants: tuple[str, ...] = Field((), description="the same as method.variants")
    cameras: CamerasSection = CamerasSection()
    detector: DetectorSection = DetectorSection()
    sweep: dict[str, Any] = Field({}, description="keys of a scenario, each with a list or a range of values")
    cases: dict[str, dict[str, Any]] = Field({}, description="named changes, each run with every setting of the sweep")
    gate: Gate = Gate()
