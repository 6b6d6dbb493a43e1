"""The doctor on every fault that a scenario file may give to its cameras."""

import pytest

from mvpose.calibration import diagnose
from mvpose.commands.progress import Silence, Stages
from simharness.scenario.load import load
from simharness.scenario.sections.cameras_section import FaultsSection
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.simulation import capture_trial, detect_trial

_RATE = 15.0
_SCENE = f"""
name = "doctor"
duration = 6.0
rate = {_RATE}
variants = ["fast"]
rendering.renderer = "rays"
people.count = 3
people.activities = ["walk"]
cameras.count = 4
room.walls = false
cameras.radius = 3.5
cameras.height = 2.0
cameras.jitter = 0.2
detector.profile = "typical"
"""
_POSE = {"moved-camera", "drifting-camera"}
_LENS = {"focal-length", "principal-point"}  # errors of lenses in all cameras are partly those of poses

CASES = {
    "none": ((), set()),
    "focal": (("faults.focal=0.06",), _LENS | _POSE),
    "center": (("faults.center=40",), _LENS | _POSE),
    "rotation": (("faults.rotation=1.5",), _POSE),
    "translation": (("faults.translation=0.15",), _POSE),
    "rotation_drift": (("faults.rotation_drift=40",), _POSE),
    "translation_drift": (("faults.translation_drift=3.0",), _POSE),
    "clock_offset": (("faults.clock_offset=0.08",), {"clock-offset"}),
    "clock_jitter": (("faults.clock_jitter=0.005",), set()),
    "dropped": (("faults.dropped=0.2",), set()),
    "frozen": (("faults.frozen=0.2",), {"repeated-pictures"}),
    "dead": (("faults.dead=[1]",), {"silent-view"}),
    "swapped": (("faults.swapped=[[0, 2]]",), {"cameras-swapped"}),
    "rolling_shutter": (("faults.rolling_shutter=0.02",), set()),
    "clocks_known": (("faults.clock_offset=0.08", "faults.clocks_known=true"), set()),
}

QUICK = ("none", "rotation", "swapped")


def diagnosed(tmp_path, *overrides):
    path = tmp_path / "doctor.toml"
    path.write_text(_SCENE)
    stages = Stages(Silence())
    trial = build_trial(load(path, overrides=overrides))
    detected = detect_trial(capture_trial(trial, stages), stages)
    return diagnose(trial.exposures.believed_rig, [each.detections for each in detected.frames], period=1.0 / _RATE)


def test_every_fault_of_scenario_files_has_a_case():
    assert set(CASES) == {"none", *FaultsSection.model_fields}


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in CASES]
)
def test_the_doctor_names_the_fault_and_no_other(fault, tmp_path):
    overrides, kinds = CASES[fault]
    named = {each.kind for each in diagnosed(tmp_path, *overrides).alarms}
    assert named <= kinds
    assert bool(named) == bool(kinds)
