"""Export of a scenario as a sequence on disk: pictures, true poses, detections and calibration, frame by frame."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose import Detections, Rig
from mvpose.commands.progress import Reporter, Silence, Stages
from mvpose.files.atomic_files import atomic_folder
from mvpose.formats.detections.openpose import people_file
from mvpose.skeleton import PANOPTIC19
from simharness.formats.panoptic_poses import body_scene, confidences
from simharness.outputs.benchmark.cameras import hd_names, renamed, write_cameras
from simharness.outputs.benchmark.layout import Layout, check_place
from simharness.outputs.benchmark.manifest import manifest
from simharness.outputs.benchmark.recording_description import write_description
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

_JPEG_QUALITY = 95
_FINER = 2  # samples per pixel along each axis, against aliasing


@dataclass(frozen=True)
class ExportPlan:
    """Content and place of an exported sequence.

    Attributes:
        folder: folder of the sequence; an earlier export there is replaced.
        every: step between written frames; files are numbered by frame.
        pictures: whether pictures are written.

    Raises:
        ValueError: the folder exists and is no export, or cannot be created; ``every`` below 1.
    """

    folder: Path
    every: int = 1
    pictures: bool = True

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ValueError(f"--every must be 1 or more, got {self.every}")
        check_place(self.folder)


def export_sequence(
    scenario: Scenario, plan: ExportPlan, *, reporter: Reporter | None = None, command: str | None = None
) -> Path:
    """Write a scenario as a sequence in the layout of the CMU Panoptic toolbox (:mod:`.layout`).

    The folder appears when it is complete. All frames are detected before the first is written, because detector errors
    depend on earlier frames; pictures are rendered and written one by one.

    Args:
        scenario: resolved scenario with its seed; its method is not run.
        plan: content and place of the sequence.
        reporter: receiver of progress.
        command: command of the user, for the manifest.

    Returns:
        The folder of the sequence.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    reporter, start = reporter or Silence(), time.perf_counter()
    result = run_trial(scenario, until="detect", reporter=reporter)
    assert result.simulation is not None
    trial, sequence = result.simulation.trial, result.simulation.sequence
    exposures, detected = trial.exposures, result.detected.frames
    names = hd_names([camera.name for camera in exposures.believed_rig])
    true_rig, believed_rig = renamed(exposures.true_rig, names), renamed(exposures.believed_rig, names)
    joints = sequence.of_skeleton(PANOPTIC19)
    picture_source = picture_source_of(scenario, Playback(trial.scene)) if plan.pictures else None
    frames = range(0, scenario.frames, plan.every)
    with Stages(reporter).stage("write", len(frames)) as advance, atomic_folder(plan.folder) as partial:
        layout = Layout(partial, scenario.name)
        layout.make_folders(names, pictures=plan.pictures)
        layout.scenario.write_text(dumps(scenario), encoding="utf-8")
        write_cameras(layout.calibration, true_rig, source=scenario.name)
        if faulty := not _same_cameras(true_rig, believed_rig):
            write_cameras(layout.believed, believed_rig, source=f"{scenario.name}, as believed")
        write_description(layout, scenario, sequence, true_rig, frames=frames, believed=faulty)
        for frame in frames:
            current, here = detected[frame], sequence.present[frame]
            bodies = body_scene(
                joints[frame, here],
                confidences(current.truth.visibility[:, here]),
                ids=sequence.ids[here].tolist(),
                time=float(sequence.time[frame]),
                rate=scenario.rate,
            )
            _write_json(layout.bodies(frame), bodies)
            shown = current.detections if current.whole is None else current.whole.detections
            _write_people(layout, names, frame, shown)
            if picture_source is not None:
                for view, name in enumerate(names):
                    _write_picture(
                        layout.picture(name, frame), picture_source.picture(exposures, frame, view, finer=_FINER)
                    )
            advance(1)
        description = manifest(
            trial,
            frames=frames,
            names=names,
            pictures=plan.pictures,
            believed=faulty,
            command=command,
            seconds=round(time.perf_counter() - start, 3),
        )
        layout.manifest.write_text(json.dumps(description, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return plan.folder


def _same_cameras(one: Rig, other: Rig) -> bool:
    return all(
        np.array_equal(getattr(a, key), getattr(b, key))
        for a, b in zip(one, other, strict=True)
        for key in ("K", "R", "t", "distortion")
    )


def _write_people(layout: Layout, names: Sequence[str], frame: int, detections: Detections) -> None:
    for view, name in enumerate(names):
        of_view = detections.view == view
        keypoints, scores = detections.keypoints[of_view], detections.scores[of_view]
        _write_json(layout.people(name, frame), people_file(keypoints, scores, skeleton=detections.skeleton))


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


def _write_picture(path: Path, rgb: NDArray[np.uint8]) -> None:
    encoded, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    if not encoded:
        raise RuntimeError(f"OpenCV cannot encode a picture of shape {rgb.shape} as JPEG")
    path.write_bytes(data.tobytes())
