"""All keys of a scenario file: a scenario, the presets and bases with which it begins, and the keys of a study.

A :class:`~simharness.scenario.sections.scenario.Scenario` remains when presets, bases and sweeps are resolved.
"""

from typing import Annotated, Any

from pydantic import Field

from simharness.scenario.sections.cameras_section import CamerasSection, SensorSection
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.gate_section import GateSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.sections.section import key

MOST_TRIALS = 1_000_000
"""Largest number of trials of a study, and of its seeds."""

Seed = Annotated[int, Field(ge=0, lt=2**53)]


class CamerasFileSection(CamerasSection):
    """[cameras] of a file."""

    rig: str = key(
        "", "rig with which the section begins: a name in scenarios/rigs, or a TOML file; other keys change it"
    )


class SensorFileSection(SensorSection):
    """[sensor] of a file."""

    profile: str = key(
        "machine-vision",
        "sensor profile with which the section begins: a name in scenarios/sensors, or a TOML file; other "
        "keys change it; perfect: the pictures as rendered",
    )


class DetectorFileSection(DetectorSection):
    """[detector] of a file."""

    profile: str = key(
        "typical",
        "detector profile with which the section begins: a name in scenarios/detectors, or a TOML file; "
        "other keys change it",
    )


class ScenarioFile(Scenario):
    """Keys of a scenario file. :mod:`simharness.scenario.load` gives them meaning."""

    extends: str = key(
        "",
        "scenario with which the file begins: a file, relative to this one, or the name of a shipped "
        "scenario; keys of this file go over it",
    )
    seeds: (
        Annotated[int, Field(ge=1, le=MOST_TRIALS)]
        | Annotated[tuple[Seed, ...], Field(min_length=1, max_length=MOST_TRIALS)]
    ) = key(1, "number of seeds, from the scenario's seed on, or a list of seeds")
    variants: tuple[str, ...] = key((), "the same as method.variants", max_length=100)
    cameras: CamerasFileSection = CamerasFileSection()
    sensor: SensorFileSection = SensorFileSection()
    detector: DetectorFileSection = DetectorFileSection()
    sweep: dict[str, Any] = key({}, "keys of a scenario, each with a list or a range of values")
    cases: dict[str, dict[str, Any]] = key({}, "named changes, each run with every setting of the sweep")
    search: dict[str, Any] = key({}, "keys that a hunt may change, each with a list or a range of values")
    gate: GateSection = GateSection()
