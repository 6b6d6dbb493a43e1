"""Export of a scenario as a sequence on disk: pictures, true poses, detections and calibration, frame by frame.

Cameras have names that loaders of Panoptic know, and the sequence is described as a recording as well, for
``simharness evaluate`` and the other commands on recordings.
"""

import json
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from mvpose import SHELF14, Rig
from mvpose.arrays import Floats
from mvpose.commands.output_files import check_writable
from mvpose.commands.progress import Reporter, Silence, Stages
from mvpose.files.atomic_files import atomic_folder
from mvpose.formats.calibration.panoptic import write_calibration
from mvpose.formats.detections.openpose import people_file
from mvpose.formats.people import write_people
from mvpose.formats.people.panoptic_poses import body_scene
from mvpose.recording import People
from mvpose.skeleton import PANOPTIC19
from simharness.outputs.benchmark.coco_truth import COCO, write_coco
from simharness.outputs.benchmark.layout import FORMAT, Layout, confidences, manifest, readable_json, write_json
from simharness.outputs.benchmark.picture_truth import HEATMAPS, VISIBILITY, write_heatmaps, write_visibility
from simharness.outputs.benchmark.render import CHANNELS, channel_image, write_image
from simharness.outputs.benchmark.submission import write_exact
from simharness.reality.annotation_errors import annotate_simulation
from simharness.scenario.sections.scenario import Scenario
from simharness.scenario.toml_files import dumps, dumps_keys
from simharness.trial.run_trial import run_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.world.scene.playback import Playback

_HD = re.compile(r"00_\d\d")
_HEAD = (
    "# The detections and the truth of this sequence as a recording: simharness evaluate FOLDER\n"
    "# Frames are counted as they were written: frame k is the k-th file of each camera.\n"
)
_TRUTH = (COCO, VISIBILITY, HEATMAPS)
_JPEG = (cv2.IMWRITE_JPEG_QUALITY, 95)
_FINER = 2  # samples per pixel along each axis, against aliasing


@dataclass(frozen=True)
class ExportPlan:
    """Content and place of an exported sequence.

    Raises:
        ValueError: the folder exists and is no export, or cannot be created; ``every`` below 1, or unknown ``also``.
    """

    folder: Path
    """Folder of the sequence; an earlier export there is replaced."""
    every: int = 1
    """Step between written frames; files are numbered by frame."""
    pictures: bool = True
    """Whether pictures are written."""
    also: frozenset[str] = frozenset()
    """More files: the channels of :mod:`.render` as PNG, and truth in the pictures, "coco" (:mod:`.coco_truth`),
    "visibility" and "heatmaps" (:mod:`.picture_truth`)."""

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ValueError(f"--every must be 1 or more, got {self.every}")
        if unknown := self.also - {*CHANNELS, *_TRUTH}:
            expected = ", ".join((*CHANNELS, *_TRUTH))
            raise ValueError(f"--also: unknown {', '.join(sorted(unknown))}; expected any of {expected}")
        check_writable(self.folder, FORMAT, option="")


def export_sequence(
    scenario: Scenario,
    plan: ExportPlan,
    *,
    reporter: Reporter | None = None,
    command: str | None = None,
    request: Mapping[str, Any] | None = None,
) -> Path:
    """Write a scenario as a sequence in the layout of the CMU Panoptic toolbox (:mod:`.layout`).

    The folder appears when it is complete. All written frames are detected before the first is written; pictures are
    rendered and written one by one.

    Args:
        scenario: resolved scenario with its seed; its method is not run.
        plan: content and place of the sequence.
        reporter: receiver of progress.
        command: command of the user, for the manifest.
        request: key of the manifest by which the sequence is known to be what a benchmark needs.

    Returns:
        The folder of the sequence.

    Raises:
        ValueError: the scenario cannot be built.
        RunError: any error after that.
    """
    reporter, start = reporter or Silence(), time.perf_counter()
    result = run_trial(scenario, until="detect", reporter=reporter, every=plan.every)
    assert result.simulation is not None
    trial, sequence = result.simulation.trial, result.simulation.sequence
    exposures, detected = trial.exposures, result.detected.frames
    names = hd_names([camera.name for camera in exposures.believed_rig])
    true_rig, believed_rig = renamed(exposures.true_rig, names), renamed(exposures.believed_rig, names)
    joints = sequence.of_skeleton(PANOPTIC19)
    channels = sorted(plan.also & set(CHANNELS))
    source = picture_source_of(scenario, Playback(trial.scene)) if plan.pictures or channels else None
    frames = range(0, scenario.frames, plan.every)
    with Stages(reporter).stage("write", len(frames)) as advance, atomic_folder(plan.folder, FORMAT) as partial:
        layout = Layout(partial, scenario.name)
        layout.path("scenario").write_text(dumps(scenario), encoding="utf-8")
        write_cameras(layout.path("calibration"), true_rig, source=scenario.name)
        if faulty := not _same_cameras(true_rig, believed_rig):
            write_cameras(layout.path("calibration_believed"), believed_rig, source=f"{scenario.name}, as believed")
        _write_description(layout, scenario, annotate_simulation(scenario, sequence, true_rig), frames, believed=faulty)
        for frame in frames:
            current, here = detected[frame], sequence.present[frame]
            bodies = body_scene(
                joints[frame, here],
                confidences(current.truth.visibility[:, here]),
                ids=sequence.ids[here].tolist(),
                time=float(sequence.time[frame]),
                rate=scenario.rate,
            )
            write_json(layout.path("bodies", frame=frame), bodies)
            shown = current.detections if current.whole is None else current.whole.detections
            for view, name in enumerate(names):
                seen = shown.select(shown.view == view)
                file = people_file(seen.keypoints, seen.scores, skeleton=seen.skeleton)
                write_json(layout.path("detections", camera=name, frame=frame), file)
                if HEATMAPS in plan.also:
                    path = layout.channel(HEATMAPS, name, frame).with_suffix(".npz")
                    write_heatmaps(path, current.truth, view, true_rig[view].size)
            if source is not None:
                for view, name in enumerate(names):
                    if plan.pictures:
                        picture = source.picture(exposures, frame, view, finer=_FINER)
                        path = layout.path("pictures", camera=name, frame=frame)
                        write_image(path, picture[..., ::-1], *_JPEG)
                    for channel in channels:
                        image = channel_image(source, trial, frame, view, channel)
                        write_image(layout.channel(channel, name, frame), image)
            advance(1)
        write_exact(layout.path("exact"), result.recording, frames)
        truth, people = {frame: detected[frame].truth for frame in frames}, sequence.ids.tolist()
        if COCO in plan.also:
            write_coco(layout, believed_rig, truth, people)
        if VISIBILITY in plan.also:
            write_visibility(layout, names, truth, people)
        description = manifest(
            trial,
            frames=frames,
            names=names,
            pictures=plan.pictures,
            believed=faulty,
            command=command,
            seconds=round(time.perf_counter() - start, 3),
        ) | {"request": request or {}}
        (layout.folder / "manifest.json").write_bytes(readable_json(description))
    return plan.folder


def _same_cameras(one: Rig, other: Rig) -> bool:
    return all(
        np.array_equal(getattr(a, key), getattr(b, key))
        for a, b in zip(one, other, strict=True)
        for key in ("K", "R", "t", "distortion")
    )


def hd_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of HD cameras (00_00, 00_01, ...) in the order of the rig; existing names of this form are kept.

    So loaders that list Panoptic cameras by number (0 3, 0 6, ...) find them in a twin of a Panoptic sequence.
    """
    if all(map(_HD.fullmatch, names)):
        return tuple(names)
    return tuple(f"00_{view:02d}" for view in range(len(names)))


def renamed(rig: Rig, names: Sequence[str]) -> Rig:
    """Return the same cameras with other names."""
    return Rig([replace(camera, name=name) for camera, name in zip(rig, names, strict=True)])


def write_cameras(path: Path, rig: Rig, *, source: str) -> None:
    """Write a Panoptic calibration with ``panel`` and ``node``, by which loaders select cameras.

    Args:
        path: path of the JSON file.
        rig: cameras with names of HD cameras.
        source: value of ``calibDataSource``.
    """
    write_calibration(path, rig)
    entries = json.loads(path.read_text(encoding="utf-8"))["cameras"]
    for entry in entries:
        entry["panel"], entry["node"] = map(int, entry["name"].split("_"))
    path.write_text(json.dumps({"calibDataSource": source, "cameras": entries}, indent=1) + "\n", encoding="utf-8")


def _write_description(layout: Layout, scenario: Scenario, joints: Floats, frames: range, *, believed: bool) -> None:
    """Write ``recording.toml`` and the truth that it names.

    Args:
        layout: paths of the sequence.
        scenario: the scenario.
        joints: joints of all people in all frames as annotated, (T, P, 14, 3), metres.
        frames: exported frames.
        believed: whether the layout has a believed calibration, which is then the calibration of the recording.
    """
    rate = scenario.rate / frames.step
    truth = People(np.arange(len(frames)) / rate, np.arange(joints.shape[1]), joints[list(frames)], skeleton=SHELF14)
    write_people(truth, layout.folder, formats=["npz"])[0].rename(layout.path("truth"))
    keys: dict[str, Any] = {
        "name": scenario.name,
        "rate": rate,
        "frames": [[0, len(frames) - 1]],
        "calibration": {"file": layout.path("calibration_believed" if believed else "calibration").name},
        "detections": {
            "format": "openpose",
            "path": "openpose",
            "first": 0,
            "skeleton": "body25",
            "kind": scenario.detector.kind,
        },
        "truth": {"format": "npz", "file": layout.path("truth").name, "skeleton": "shelf14"},
    }
    layout.path("recording").write_text(f"{_HEAD}{dumps_keys(keys)}", encoding="utf-8")
