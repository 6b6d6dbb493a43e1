"""Layout of an exported sequence, that of the CMU Panoptic toolbox: folders, file names, and the manifest.

    calibration_NAME.json, calibration_believed_NAME.json
    hdImgs/00_00/00_00_00000000.jpg, depth/00_00/00_00_00000000.png, ids/..., parts/..., coco/00_00.json
    visibility.npz, heatmaps/00_00/00_00_00000000.npz
    hdPose3d_stage1_coco19/body3DScene_00000000.json
    openpose/00_00/00_00_00000000_keypoints.json
    manifest.json, scenario.toml, recording.toml, truth.npz, exact.npz

The believed calibration, ``openpose`` and the files of the last line are additions of simharness; the rest is the
toolbox's layout (https://github.com/CMU-Perceptual-Computing-Lab/panoptic-toolbox).

In ``body3DScene`` files the confidence of a joint says how many pictures show it. Simulated joints are always defined,
even where they are hidden; the dataset's mark of an undefined joint (0 0 0 -1) is never written.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from mvpose.formats.joint_names import KNOWN
from mvpose.skeleton import COCO17, PANOPTIC19
from mvpose.wholebody import skeleton_by_name
from simharness.outputs import texts_of
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.identity import provenance
from simharness.trial.stages.build_trial import Trial
from simharness.types.views import Visibility
from simharness.world.humans.population import is_child
from simharness.world.motion.choreography import roles
from simharness.world.rigs.faults import ExposureSchedule

FORMAT = "simharness export"
"""Value of ``format`` in the manifest of an export."""

FILES = {
    "calibration": "calibration_{name}.json",  # of the true rig
    "calibration_believed": "calibration_believed_{name}.json",  # of the believed rig, where it differs
    "pictures": "hdImgs/{camera}/{camera}_{frame:08d}.jpg",  # of a camera in a frame
    "bodies": "hdPose3d_stage1_coco19/body3DScene_{frame:08d}.json",  # true poses of a frame
    "detections": "openpose/{camera}/{camera}_{frame:08d}_keypoints.json",  # in the picture of a camera
    "scenario": "scenario.toml",  # the resolved scenario
    "recording": "recording.toml",  # the sequence described as a recording
    "truth": "truth.npz",  # true joints of the recording
    "exact": "exact.npz",  # given rig and detections, and exact truth, for ``simharness score``
}
"""Files of a sequence beside the manifest."""


@dataclass(frozen=True)
class Layout:
    """Paths of a sequence."""

    folder: Path
    """Folder of the sequence."""
    name: str
    """Name of the sequence, used in the names of calibration files; the folder may have another name."""

    def path(self, file: str, **of: Any) -> Path:
        """Return the path of one of :data:`FILES`, of the ``camera`` and the ``frame`` where each has one."""
        return self.folder / FILES[file].format(name=self.name, **of)

    def channel(self, channel: str, camera: str, frame: int) -> Path:
        """Return the path of a channel of a picture, such as depth."""
        return self.folder / channel / camera / f"{camera}_{frame:08d}.png"


def readable_json(content: dict[str, Any]) -> bytes:
    """Return the bytes of a JSON file for people: indented, with all letters as they are."""
    return (json.dumps(content, indent=2, ensure_ascii=False) + "\n").encode()


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file for programs, and its folder where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


CONFIDENCES = {"two or more": 1.0, "one": 0.5, "none": 0.2, "none, nor any joint of the person": 0.0}
"""Confidence of a joint by the number of pictures that show it.

Loaders drop joints with a confidence below 0.1, and people whose middle of the hips has such a confidence. So a hidden
joint gets 0.2 where another joint of the person is visible (a table hides the hips, and the person is kept), and 0
where no picture shows the person at all (the person is dropped).
"""

_MADE_FROM = {"neck": ("left_shoulder", "right_shoulder"), "mid_hip": ("left_hip", "right_hip")}
_SEEN_WITH = [[COCO17.index(each) for each in _MADE_FROM.get(joint, (joint,))] for joint in PANOPTIC19.joints]


def confidences(visibility: ArrayLike) -> Floats:
    """Return the confidence of every joint, (P, 19), one of the values of :data:`CONFIDENCES`.

    Args:
        visibility: :class:`simharness.types.views.Visibility` of COCO-17 in the pictures of a frame,
            (V, P, 17). The neck counts as visible where a shoulder is, the middle of the hips where a hip is.
    """
    visible = np.asarray(visibility) == Visibility.VISIBLE
    seen = np.stack([visible[..., joints].any(axis=-1) for joints in _SEEN_WITH], axis=-1).sum(axis=0)
    person_seen = (seen > 0).any(axis=-1, keepdims=True)
    two, one, hidden, unseen = CONFIDENCES.values()
    return np.select([seen >= 2, seen == 1], [two, one], np.where(person_seen, hidden, unseen))


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
    missing = {key for key, there in (("pictures", pictures), ("calibration_believed", believed)) if not there}
    files = {key: None if key in missing else file.replace("{name}", scenario.name) for key, file in FILES.items()}
    return {
        "format": FORMAT,
        "version": 1,
        "name": scenario.name,
        "description": scenario.description,
        "seed": scenario.seed,
        "rate": scenario.rate,
        "frames": {"first": frames.start, "every": frames.step, "count": len(frames)},
        "files": files,
        **{key: texts_of("manifest")[key] for key in ("units", "axes", "calibration", "bodies")},
        "confidence": {"joint, by the number of pictures that show it": CONFIDENCES}
        | texts_of("manifest")["confidence"],
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
    parts = [] if {"neck", "mid_hip"} <= set(names) else [texts_of("manifest")["made"]]
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
