"""What the cameras of a scenario record, as files: a picture or a film for each camera, and one of all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose import Detections, Estimate
from simharness.capture.picture import PictureSource
from simharness.report.figures.mosaic import mosaic
from simharness.report.run.pictures import annotate
from simharness.runtime.atomic_files import atomic_folder
from simharness.runtime.progress import Reporter, Silence
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.run_trial import Goal, run_trial
from simharness.trial.stages.build_trial import Trial, build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.types.truth import Truth
from simharness.world.scene.playback import Playback

Rgb = NDArray[np.uint8]

LAYERS = ("truth", "detections", "estimates")
CHANNELS = ("depth", "ids", "parts")
_WIDEST = 1920  # pixels of a mosaic


@dataclass(frozen=True)
class Footage:
    """How a scenario is rendered.

    Attributes:
        video: one MP4 a camera instead of one PNG a picture.
        overlay: which of ``LAYERS`` are drawn in.
        channels: which of ``CHANNELS`` are written beside every picture, as PNG: depth in millimetres in 16 bits, 0
            where nothing is seen; ids in 8 bits, 1 and up the people, 255 things and the room, 0 nothing; parts in 8
            bits, :class:`simharness.world.humans.segments.Segment` + 1, 0 where there is no body.
        every: frames from one that is rendered to the next.
        finer: samples a pixel each way.
    """

    video: bool = False
    overlay: frozenset[str] = frozenset()
    channels: frozenset[str] = frozenset()
    every: int = 1
    finer: int = 2

    def __post_init__(self) -> None:
        for option, asked, known in (("--overlay", self.overlay, LAYERS), ("--also", self.channels, CHANNELS)):
            unknown = asked - set(known)
            if unknown:
                raise ValueError(f"{option}: {', '.join(sorted(unknown))} is not known; there are {', '.join(known)}")
        if self.video and self.channels:
            raise ValueError("--also goes with pictures, not with --video: depth and ids do not survive a film's codec")
        if self.every < 1:
            raise ValueError(f"--every must be 1 or more, got {self.every}")


def render(scenario: Scenario, footage: Footage, *, out: Path, reporter: Reporter | None = None) -> Path:
    """Render a scenario.

    Args:
        scenario: what to film.
        footage: how.
        out: where the folder ``<name>`` goes; it appears when it is whole, and replaces an earlier one.
        reporter: is told of the stages.

    Returns:
        The folder: ``<camera>/0000.png`` (and ``0000.depth.png``, ...) or ``<camera>.mp4`` for each camera, and
        ``mosaic`` like them.

    Raises:
        ValueError: the scenario cannot be built, or a layer that does not exist.
    """
    reporter = reporter or Silence()
    trial, layers = _layers(scenario, footage, reporter)
    picture_source = picture_source_of(scenario, Playback(trial.scene))
    frames = range(0, scenario.frames, footage.every)
    names = [*(camera.name for camera in trial.exposures.believed_rig), "mosaic"]
    folder = out / scenario.name
    with reporter.stage("render", len(frames)) as advance, atomic_folder(folder) as partial, ExitStack() as stack:
        write: Callable[[str, int, Rgb], None] = _Stills(partial)
        if footage.video:
            write = stack.enter_context(_Films(partial, rate=scenario.rate / footage.every))
        for frame, pictures in zip(frames, _pictures(trial, picture_source, footage, layers, frames), strict=True):
            sheet = mosaic(pictures, names[:-1])
            shrink = min(1.0, _WIDEST / sheet.shape[1])
            small = cv2.resize(sheet, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA).astype(np.uint8)
            for name, picture in zip(names, [*pictures, small], strict=True):
                write(name, frame, picture)
            for view, name in enumerate(names[:-1]):
                for channel in sorted(footage.channels):
                    _write(
                        partial / name / f"{frame:04d}.{channel}.png",
                        _channel(picture_source, trial, frame, view, channel),
                    )
            advance(1)
    return folder


@dataclass(frozen=True)
class _Layers:
    """What is known of every frame; estimates only where they are drawn."""

    truth: Sequence[Truth]
    detections: Sequence[Detections]
    estimates: Sequence[Estimate] | None


def _layers(scenario: Scenario, footage: Footage, reporter: Reporter) -> tuple[Trial, _Layers | None]:
    """Build the trial, and run it as far as the overlays need."""
    if not footage.overlay:
        with reporter.stage("build", 1):
            return build_trial(scenario), None
    first = scenario.method.variants[:1]
    until: Goal = "estimate" if "estimates" in footage.overlay else "detect"
    result = run_trial(scenario, variants=first, until=until, reporter=reporter)
    recording = result.recording
    return result.trial, _Layers(recording.truth, recording.detections, result.estimates.get(first[0]))


def _pictures(
    trial: Trial, picture_source: PictureSource, footage: Footage, layers: _Layers | None, frames: range
) -> Iterator[list[Rgb]]:
    """The pictures of all views of each frame, one frame after the other."""
    shown = footage.overlay
    for frame in frames:
        pictures = []
        for view in range(len(trial.exposures.believed_rig)):
            rgb = picture_source.picture(trial.exposures, frame, view, finer=footage.finer)
            if layers is not None:
                rgb = annotate(
                    rgb,
                    trial.exposures.camera(frame, view),
                    view,
                    truth=layers.truth[frame],
                    detections=layers.detections[frame] if "detections" in shown else None,
                    estimate=layers.estimates[frame] if layers.estimates is not None else None,
                    show_truth="truth" in shown,
                )
            pictures.append(rgb)
        yield pictures


def _channel(
    picture_source: PictureSource, trial: Trial, frame: int, view: int, channel: str
) -> NDArray[np.unsignedinteger]:
    """What is known of every pixel of a picture, as integers that a PNG holds; zeros where no picture arrives."""
    if not trial.exposures.delivered[frame, view]:
        width, height = trial.exposures.believed_rig[view].size
        return np.zeros((height, width), np.uint16 if channel == "depth" else np.uint8)
    image = picture_source.image(trial.exposures, frame, view)
    if channel == "depth":
        millimetres = np.where(np.isfinite(image.depth), 1000.0 * image.depth, 0.0)
        return np.clip(np.rint(millimetres), 0, 65535).astype(np.uint16)
    if channel == "ids":
        return np.where(image.ids >= len(trial.scene.bodies), 255, image.ids + 1).astype(np.uint8)
    assert image.parts is not None  # which was asked for
    return (image.parts + 1).astype(np.uint8)


def _write(path: Path, picture: NDArray[np.unsignedinteger]) -> None:
    path.parent.mkdir(exist_ok=True)
    if not cv2.imwrite(str(path), picture):
        raise RuntimeError(f"OpenCV cannot write a picture of {picture.shape} to {path}")


class _Stills:
    """A PNG for each picture, in a folder for each name."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __call__(self, name: str, frame: int, rgb: Rgb) -> None:
        _write(self._folder / name / f"{frame:04d}.png", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR).astype(np.uint8))


class _Films:
    """An MP4 for each name, written as the frames come."""

    def __init__(self, folder: Path, *, rate: float) -> None:
        self._folder = folder
        self._rate = rate
        self._writers: dict[str, cv2.VideoWriter] = {}

    def __enter__(self) -> _Films:
        return self

    def __exit__(self, *_: object) -> None:
        for writer in self._writers.values():
            writer.release()

    def __call__(self, name: str, frame: int, rgb: Rgb) -> None:
        even = rgb[: rgb.shape[0] // 2 * 2, : rgb.shape[1] // 2 * 2]  # the codec halves colour both ways
        if name not in self._writers:
            path, size = self._folder / f"{name}.mp4", (even.shape[1], even.shape[0])
            writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), self._rate, size)
            if not writer.isOpened():
                raise RuntimeError(
                    f"OpenCV cannot write a film of {size[0]} x {size[1]} at {self._rate:g} Hz to {path}"
                )
            self._writers[name] = writer
        self._writers[name].write(cv2.cvtColor(even, cv2.COLOR_RGB2BGR))
