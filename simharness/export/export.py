"""A scenario as a sequence on disk: pictures, true poses, detections and calibration, written frame by frame."""

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
from mvpose.skeleton import PANOPTIC19
from simharness.export.cameras import hd_names, renamed, write_cameras
from simharness.export.layout import Layout, check_place
from simharness.export.manifest import manifest
from simharness.formats.openpose import people_file
from simharness.formats.panoptic_poses import body_scene, confidences
from simharness.runtime.atomic_files import atomic_folder
from simharness.runtime.progress import Reporter, Silence
from simharness.runtime.stages import Stages
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

_QUALITY = 95  # of JPEG
_FINER = 2  # samples a pixel each way, for smooth outlines


@dataclass(frozen=True)
class Export:
    """What is to be written, and where.

    Attributes:
        folder: of the sequence; an earlier export there is replaced.
        every: frames from one that is written to the next; files are numbered by frame.
        pictures: whether pictures are written.

    Raises:
        ValueError: a folder that is there and is no export, or that cannot be made; ``every`` below 1.
    """

    folder: Path
    every: int = 1
    pictures: bool = True

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ValueError(f"--every must be 1 or more, got {self.every}")
        check_place(self.folder)


def export(scenario: Scenario, plan: Export, *, reporter: Reporter | None = None, command: str | None = None) -> Path:
    """Write a scenario as a sequence in the layout of the CMU Panoptic toolbox (:mod:`simharness.export.layout`).

    The folder appears when it is whole. What the cameras see is known of all frames before the first is written, for
    a detector's errors last; pictures are drawn and written one by one.

    Args:
        scenario: a resolved scenario with its seed; its method is not run.
        plan: how much of it, and where.
        reporter: receiver of progress.
        command: the user's command, for the manifest.

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
    taking, told = renamed(exposures.true_rig, names), renamed(exposures.believed_rig, names)
    joints = sequence.of_skeleton(PANOPTIC19)
    picture_source = picture_source_of(scenario, Playback(trial.scene)) if plan.pictures else None
    frames = range(0, scenario.frames, plan.every)
    with Stages(reporter).stage("write", len(frames)) as advance, atomic_folder(plan.folder) as partial:
        layout = Layout(partial, scenario.name)
        layout.make_folders(names, pictures=plan.pictures)
        layout.scenario.write_text(dumps(scenario), encoding="utf-8")
        write_cameras(layout.calibration, taking, source=scenario.name)
        if mistaken := not _same(taking, told):
            write_cameras(layout.believed, told, source=f"{scenario.name}, as believed")
        for frame in frames:
            seen = detected[frame]
            bodies = body_scene(
                joints[frame],
                confidences(seen.truth.visibility),
                ids=sequence.ids.tolist(),
                time=float(sequence.time[frame]),
                rate=scenario.rate,
            )
            _write_json(layout.bodies(frame), bodies)
            _write_people(layout, names, frame, seen.detections)
            if picture_source is not None:
                for view, name in enumerate(names):
                    _write_picture(
                        layout.picture(name, frame), picture_source.picture(exposures, frame, view, finer=_FINER)
                    )
            advance(1)
        about = manifest(
            trial,
            frames=frames,
            names=names,
            pictures=plan.pictures,
            believed=mistaken,
            command=command,
            seconds=round(time.perf_counter() - start, 3),
        )
        layout.manifest.write_text(json.dumps(about, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
    return plan.folder


def _same(one: Rig, other: Rig) -> bool:
    return all(
        np.array_equal(getattr(a, key), getattr(b, key))
        for a, b in zip(one, other, strict=True)
        for key in ("K", "R", "t", "distortion")
    )


def _write_people(layout: Layout, names: Sequence[str], frame: int, detections: Detections) -> None:
    for view, name in enumerate(names):
        mine = detections.view == view
        _write_json(layout.people(name, frame), people_file(detections.keypoints[mine], detections.scores[mine]))


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    path.write_text(json.dumps(content, allow_nan=False) + "\n", encoding="utf-8")


def _write_picture(path: Path, rgb: NDArray[np.uint8]) -> None:
    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    if not done:
        raise RuntimeError(f"OpenCV cannot make a JPEG of a picture of {rgb.shape}")
    path.write_bytes(data.tobytes())
