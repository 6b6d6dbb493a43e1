"""Rendered pictures or films of all cameras of a scenario, and a mosaic of them, as files."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose import Estimate
from mvpose.commands.output_files import check_writable
from mvpose.commands.progress import Reporter, Silence
from mvpose.files.atomic_files import atomic_folder
from mvpose.report.film_file import FilmFile
from mvpose.report.overlay import mosaic
from simharness.capture.picture import ScenePictures
from simharness.outputs.run.pictures import annotate
from simharness.scenario.sections.scenario import Scenario
from simharness.trial.run_trial import Goal, run_trial
from simharness.trial.stages.build_trial import Trial, build_trial
from simharness.trial.stages.capture import picture_source_of
from simharness.types.recording import Recording
from simharness.world.scene.playback import Playback

Rgb = NDArray[np.uint8]

LAYERS = ("truth", "detections", "estimates")
"""Layers that can be drawn into the pictures."""

CHANNELS = ("depth", "ids", "parts")
"""Images that can be written beside the pictures."""

_RENDER = "simharness render"
_FILM_QUALITY = 24  # constant rate factor of VP9: finer than on pages
_MOSAIC_WIDTH = 1920  # largest width, pixels


@dataclass(frozen=True)
class RenderPlan:
    """Content and format of rendered files.

    Raises:
        ValueError: an unknown layer or channel, channels of a video, or ``every`` below 1.
    """

    video: bool = False
    """One MP4 for each camera instead of one PNG for each picture."""
    overlay: frozenset[str] = frozenset()
    """Layers drawn into the pictures, of ``LAYERS``."""
    channels: frozenset[str] = frozenset()
    """Images written beside every picture as PNG, of ``CHANNELS``. depth: 16 bits, millimetres, 0 for no surface. ids:
    8 bits, person + 1, 255 for objects and the room, 0 for none. parts: 8 bits,
    :class:`simharness.world.humans.anatomy.Segment` + 1, 0 where there is no body."""
    every: int = 1
    """Step between rendered frames."""
    finer: int = 2
    """Samples per pixel along each axis."""

    def __post_init__(self) -> None:
        for option, given, known in (("--overlay", self.overlay, LAYERS), ("--also", self.channels, CHANNELS)):
            unknown = given - set(known)
            if unknown:
                raise ValueError(f"{option}: unknown {', '.join(sorted(unknown))}; expected any of {', '.join(known)}")
        if self.video and self.channels:
            raise ValueError(
                "--also needs pictures, not --video, because video compression changes depth and ids; omit one"
            )
        if self.every < 1:
            raise ValueError(f"--every must be 1 or more, got {self.every}")


def render(scenario: Scenario, plan: RenderPlan, *, out: Path, reporter: Reporter | None = None) -> Path:
    """Render the pictures of all cameras of a scenario to files.

    Args:
        scenario: scenario to render.
        plan: content and format of the files.
        out: parent of the folder ``<name>``, which appears when it is complete and replaces an earlier one.
        reporter: receiver of progress.

    Returns:
        The folder: ``<camera>/0000.png`` (and ``0000.depth.png``, ...) or ``<camera>.mp4`` for each camera, and
        ``mosaic`` like them.

    Raises:
        ValueError: the scenario cannot be built, or the folder holds something else.
    """
    reporter = reporter or Silence()
    folder = out / scenario.name
    check_writable(folder, _RENDER)
    trial, layers = _layers(scenario, plan, reporter)
    picture_source = picture_source_of(scenario, Playback(trial.scene))
    frames, rate = range(0, scenario.frames, plan.every), scenario.rate / plan.every
    names = [*(camera.name for camera in trial.exposures.believed_rig), "mosaic"]
    with (
        reporter.stage("render", len(frames)) as advance,
        atomic_folder(folder, _RENDER) as partial,
        ExitStack() as stack,
    ):
        files = [FilmFile(partial / f"{name}.mp4", rate, quality=_FILM_QUALITY) for name in names if plan.video]
        films = [stack.enter_context(each) for each in files]
        for frame, pictures in zip(frames, _pictures(trial, picture_source, plan, layers, frames), strict=True):
            sheet = mosaic(pictures, names[:-1])
            shrink = min(1.0, _MOSAIC_WIDTH / sheet.shape[1])
            small = cv2.resize(sheet, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA).astype(np.uint8)
            for k, (name, picture) in enumerate(zip(names, [*pictures, small], strict=True)):
                if films:
                    films[k].add(picture)
                else:
                    write_image(partial / name / f"{frame:04d}.png", picture[..., ::-1])
            for view, name in enumerate(names[:-1]):
                for channel in sorted(plan.channels):
                    write_image(
                        partial / name / f"{frame:04d}.{channel}.png",
                        channel_image(picture_source, trial, frame, view, channel),
                    )
            advance(1)
    return folder


Layers = tuple[Recording, Sequence[Estimate] | None]
"""Truth and detections of every frame, and the estimates if they are drawn."""


def _layers(scenario: Scenario, plan: RenderPlan, reporter: Reporter) -> tuple[Trial, Layers | None]:
    """Build the trial, and run it as far as the overlay needs; no layers without an overlay."""
    if not plan.overlay:
        with reporter.stage("build", 1):
            return build_trial(scenario), None
    first = scenario.method.variants[:1]
    until: Goal = "estimate" if "estimates" in plan.overlay else "detect"
    every = plan.every if until == "detect" else 1  # estimates of trackers depend on all frames
    result = run_trial(scenario, variants=first, until=until, reporter=reporter, every=every)
    return result.trial, (result.recording, result.estimates.get(first[0]))


def _pictures(
    trial: Trial, picture_source: ScenePictures, plan: RenderPlan, layers: Layers | None, frames: range
) -> Iterator[list[Rgb]]:
    """Yield the pictures of all views, frame by frame."""
    overlay = plan.overlay
    for frame in frames:
        pictures = []
        for view in range(len(trial.exposures.believed_rig)):
            rgb = picture_source.picture(trial.exposures, frame, view, finer=plan.finer)
            if layers is not None:
                recording, estimates = layers
                rgb = annotate(
                    rgb,
                    trial.exposures.camera(frame, view),
                    view,
                    truth=recording.truth[frame],
                    detections=recording.detections[frame] if "detections" in overlay else None,
                    estimate=estimates[frame] if estimates is not None else None,
                    show_truth="truth" in overlay,
                )
            pictures.append(rgb)
        yield pictures


def channel_image(
    picture_source: ScenePictures, trial: Trial, frame: int, view: int, channel: str
) -> NDArray[np.unsignedinteger]:
    """Return a channel of one picture as integers for PNG (see ``RenderPlan``); zeros where no picture is delivered."""
    if not trial.exposures.delivered[frame, view]:
        width, height = trial.exposures.believed_rig[view].size
        return np.zeros((height, width), np.uint16 if channel == "depth" else np.uint8)
    image = picture_source.image(trial.exposures, frame, view)
    if channel == "depth":
        millimetres = np.where(np.isfinite(image.depth), 1000.0 * image.depth, 0.0)
        return np.clip(np.rint(millimetres), 0, 65535).astype(np.uint16)
    if channel == "ids":
        return np.where(image.ids >= len(trial.scene.bodies), 255, image.ids + 1).astype(np.uint8)
    assert image.parts is not None  # rendered for this channel
    return (image.parts + 1).astype(np.uint8)


def write_image(path: Path, picture: NDArray[np.unsignedinteger], *options: int) -> None:
    """Write a picture with options of OpenCV's, in the format of its name, and its folder where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), picture, options):
        raise RuntimeError(f"OpenCV cannot write a picture of shape {picture.shape} to {path}")
