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
from simharness.export.openpose import people_file
from simharness.formats.panoptic_poses import body_scene, confidences
from simharness.runtime.atomic_files import appearing
from simharness.runtime.progress import Reporter, Silence
from simharness.scenario.toml_writer import dumps
from simharness.trial.looking import look
from simharness.trial.stages.build import Trial
from simharness.trial.stages.frame_tasks import studio_of
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


def export(trial: Trial, plan: Export, *, reporter: Reporter | None = None, command: str | None = None) -> Path:
    """Write a trial as a sequence in the layout of the CMU Panoptic toolbox (:mod:`simharness.export.layout`).

    The folder appears when it is whole. What the cameras see is known of all frames before the first is written, for
    a detector's errors last; pictures are drawn and written one by one.

    Args:
        trial: what to write; its method is not run.
        plan: how much of it, and where.
        reporter: is told of the stages.
        command: how the user asked for this, for the manifest.

    Returns:
        The folder of the sequence.
    """
    reporter, start = reporter or Silence(), time.perf_counter()
    scenario, shots = trial.scenario, trial.shots
    with reporter.stage("film", 1):
        sequence, detected = look(trial)
    names = hd_names([camera.name for camera in shots.believed])
    taking, told = renamed(shots.taking, names), renamed(shots.believed, names)
    joints = sequence.of_skeleton(PANOPTIC19)
    studio = studio_of(scenario, Playback(trial.scene)) if plan.pictures else None
    frames = range(0, scenario.frames, plan.every)
    with reporter.stage("write", len(frames)) as advance, appearing(plan.folder) as partial:
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
            if studio is not None:
                for view, name in enumerate(names):
                    _write_picture(layout.picture(name, frame), studio.picture(shots, frame, view, finer=_FINER))
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
