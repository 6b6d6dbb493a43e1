"""Pictures in which the colour of a pixel names the person and the body segment."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from simharness.capture.rendering.renderer import Image
from simharness.outputs.benchmark.panoptic_sequence import hd_names
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.stages.build_trial import build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.world.humans.anatomy import Segment
from simharness.world.scene.playback import Playback

PEOPLE = 6
"""Most people of a scene, which their shades of red tell apart."""

_ANGLES = 2 * np.pi * np.arange(len(Segment)) / len(Segment)

SHADES = 30 + 35 * np.arange(PEOPLE)
"""Red of each person, (6,); none is near 114, the grey with which detectors fill the margin of a picture."""

SEGMENTS = np.round(140 + 110 * np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)).astype(np.int64)
"""Green and blue of each body segment, (14, 2): on a circle, so that no mixture of two is a third."""


def painted(image: Image) -> NDArray[np.uint8]:
    """Return the picture of an image with ids and body parts, (h, w, 3) uint8; what is no person is black."""
    assert image.parts is not None
    body = (image.ids >= 0) & (image.ids < PEOPLE) & (image.parts >= 0)
    picture = np.zeros((*body.shape, 3), np.uint8)
    picture[body, 0] = SHADES[image.ids[body]]
    picture[body, 1:] = SEGMENTS[image.parts[body]]
    return picture


def write_pictures(scenario: Scenario, folder: Path) -> list[Path]:
    """Write the pictures of all cameras of a scenario: lossless videos, and for each third camera a folder.

    Args:
        scenario: resolved scenario of at most six people.
        folder: an existing folder.

    Returns:
        For each camera the video, or the folder of pictures, with the name of the camera in an export.

    Raises:
        ValueError: more people.
    """
    if scenario.people.count > PEOPLE:
        raise ValueError(f"painted pictures tell {PEOPLE} people apart, got {scenario.people.count}")
    trial = build_trial(scenario)
    source = picture_source_of(scenario, Playback(trial.scene))
    paths = []
    for view, name in enumerate(hd_names([camera.name for camera in trial.exposures.believed_rig])):
        pictures = (painted(source.image(trial.exposures, frame, view)) for frame in range(scenario.frames))
        paths.append(folder / (name if view % 3 == 2 else f"{name}.mkv"))
        (_write_folder if view % 3 == 2 else _write_video)(paths[-1], pictures, scenario.rate)
    return paths


def _write_folder(folder: Path, pictures: Iterator[NDArray[np.uint8]], rate: float) -> None:
    folder.mkdir()
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"{number:06d}.png"), picture[..., ::-1])


def _write_video(path: Path, pictures: Iterator[NDArray[np.uint8]], rate: float) -> None:
    first = next(pictures)
    size = (first.shape[1], first.shape[0])
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), rate, size)  # lossless
    if not writer.isOpened():
        raise RuntimeError(f"this OpenCV cannot write a lossless video (FFV1) to {path}")
    for picture in (first, *pictures):
        writer.write(np.ascontiguousarray(picture[..., ::-1]))
    writer.release()
