"""Small trial with lens distortion and a wrong believed calibration, and its export."""

from __future__ import annotations

import pytest

from simharness.outputs.benchmark.panoptic_sequence import ExportPlan, export_sequence
from simharness.scenario.sections.cameras_section import CamerasSection, FaultsSection
from simharness.scenario.sections.people_section import PeopleSection
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.scenario import RenderingSection, Scenario
from simharness.trial.stages.build_trial import build_trial


def tiny(**sections) -> Scenario:
    defaults = {
        "people": PeopleSection(count=3, activities=("walk", "stand")),
        "cameras": CamerasSection(count=3, size=(320, 240), distortion=(-0.12, 0.02, 0.001, -0.002, 0.0)),
        "clutter": ClutterSection(boxes=1),
        "faults": FaultsSection(rotation=1.0, translation=0.02),
        "rendering": RenderingSection(renderer="rays"),
    }
    return Scenario(name="tiny", seed=5, duration=0.3, rate=10.0, **{**defaults, **sections})


@pytest.fixture(scope="session")
def trial():
    return build_trial(tiny())


@pytest.fixture(scope="session")
def folder(trial, tmp_path_factory):
    plan = ExportPlan(tmp_path_factory.mktemp("export") / "tiny")
    return export_sequence(trial.scenario, plan, command="simharness export tiny.toml out")


@pytest.fixture(scope="session")
def scenario():
    """Function that returns the scenario of ``trial`` with other sections."""
    return tiny
