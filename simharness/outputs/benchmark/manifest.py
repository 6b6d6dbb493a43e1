"""Manifest of an exported sequence: files, units, axes, cameras, people and provenance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mvpose.formats.joint_names import KNOWN
from mvpose.skeleton import COCO17, PANOPTIC19
from mvpose.wholebody import skeleton_by_name
from simharness.outputs.benchmark.joint_confidences import CONFIDENCES
from simharness.outputs.benchmark.layout import BODIES, FORMAT, PEOPLE, PICTURES
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.identity import provenance
from simharness.trial.stages.build_trial import Trial
from simharness.world.humans.population import is_child
from simharness.world.motion.choreography import roles
from simharness.world.rigs.exposure_schedule import ExposureSchedule

_UNITS = {
    "calibration": "x_cam = R X + t; t in centimetres; K in pixels, of which integers are the centres; distCoef k1 k2 "
    "p1 p2 k3",
    "joints19": "x y z in centimetres, confidence",
    "univTime": "milliseconds from the first frame",
    "clock": "delay of the pictures behind the times of their frames, seconds: mean and standard deviation",
    "lost": "frames whose picture never arrives; its file is black",
    "repeated": "frames in which a camera repeats an earlier picture: [frame, earlier frame]",
    "drift": "rotation of the camera about its axes, rad/s, and velocity of its centre in simharness's axes, m/s",
    "pose_keypoints_2d": "x y in pixels, score 0 to 1; 0 0 0 where missing",
    "rolling_shutter": "seconds from the first row of a picture to the last",
    "stature, mass": "metres, kilograms",
}
_AXES = "right-handed, y down, the floor at y = 0; (X, Y, Z) = 100 (x, -z, y) of simharness's metres, z up"
_CALIBRATION = (
    "the true cameras, which take the pictures, at time 0; the calibration that a method is given, with the faults of "
    "the scenario, is in calibration_believed where it differs"
)
_BODIES = (
    "all people in every frame, hidden or not, at the time of the frame, also where clocks of cameras differ; an id "
    "stands for one person in all frames"
)
_MADE = "neck and mid_hip are midpoints of shoulders and of hips, where both were detected"


def manifest(
    trial: Trial,
    *,
    frames: range,
    names: Sequence[str],
    pictures: bool,
    believed: bool,
    command: str | None,
    seconds: float,
) -> dict[str, Any]:
    """Return the manifest of a sequence, ready for JSON.

    Args:
        trial: exported trial.
        frames: exported frames.
        names: names of the cameras in the files, in the order of the rig.
        pictures: whether pictures were written.
        believed: whether a believed calibration was written.
        command: command of the user.
        seconds: duration of the export, seconds.
    """
    scenario = trial.scenario
    return {
        "format": FORMAT,
        "version": 1,
        "name": scenario.name,
        "description": scenario.description,
        "seed": scenario.seed,
        "rate": scenario.rate,
        "frames": {"first": frames.start, "every": frames.step, "count": len(frames)},
        "files": {
            "calibration": f"calibration_{scenario.name}.json",
            "calibration_believed": f"calibration_believed_{scenario.name}.json" if believed else None,
            "pictures": PICTURES if pictures else None,
            "bodies": BODIES,
            "detections": PEOPLE,
            "scenario": "scenario.toml",
            "recording": "recording.toml",
            "truth": "truth.npz",
        },
        "units": _UNITS,
        "axes": _AXES,
        "calibration": _CALIBRATION,
        "bodies": _BODIES,
        "confidence": {
            "joint, by the number of pictures that show it": CONFIDENCES,
            "none": "hidden in all pictures, which show other joints of the person",
            "nobody": "no picture shows any joint of the person",
        },
        "skeletons": {
            "joints19": PANOPTIC19.joints,
            "pose_keypoints_2d": KNOWN["body25"].joints,
            "made": _made(scenario),
        },
        "rolling_shutter": trial.exposures.readout,
        "cameras": [_camera(trial.exposures, trial.scene.time, frames, view, name) for view, name in enumerate(names)],
        "people": _people(trial),
        "provenance": provenance(command=command, seeds=[scenario.seed], variants=[], seconds=seconds),
    }


def _made(scenario: Scenario) -> str:
    """Say which joints of the detections were not detected, but made or missing."""
    names = () if scenario.detector.skeleton == COCO17.name else skeleton_by_name(scenario.detector.skeleton).joints
    parts = [] if {"neck", "mid_hip"} <= set(names) else [_MADE]
    return "; ".join([*parts, "feet are as detected" if "left_heel" in names else "feet are missing"])


def _camera(exposures: ExposureSchedule, time: np.ndarray, frames: range, view: int, name: str) -> dict[str, Any]:
    """Describe one view: the camera that takes its pictures, its clock, and its missing and repeated pictures."""
    numbers = np.array(frames)
    source, taker = exposures.source[numbers, view], int(exposures.camera_of_view[view])
    taken = source >= 0
    late = exposures.time[numbers, view][taken] - time[source[taken]]
    turn, travel = exposures.rotation_rate[taker], exposures.velocity[taker]
    drifts = turn.any() or travel.any()
    return {
        "name": name,
        "called": exposures.believed_rig[view].name,
        "pictures_of": exposures.true_cameras[taker].name,
        "size": list(exposures.believed_rig[view].size),
        "clock": {"mean": _short(late.mean()), "deviation": _short(late.std())} if taken.any() else None,
        "lost": numbers[~taken].tolist(),
        "repeated": [[int(frame), int(old)] for frame, old in zip(numbers, source, strict=True) if 0 <= old < frame],
        "drift": {"turn": turn.tolist(), "travel": travel.tolist()} if drifts else None,
    }


def _people(trial: Trial) -> list[dict[str, Any]]:
    scenario = trial.scenario
    return [
        {
            "id": person,
            "activity": role,
            "child": is_child(scenario.seed, person, scenario.people.children),
            "stature": _short(body.stature),
            "mass": _short(body.mass),
        }
        for person, (role, body) in enumerate(zip(roles(scenario), trial.scene.bodies, strict=True))
    ]


def _short(value: float) -> float:
    return round(float(value), 6)
