"""Calibration and detections of a recording, read and checked: the first step of every command about one."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.commands.programs import note

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    import mvpose
    from mvpose import Detections, Rig
    from mvpose.formats.joint_names import JointNames

Calibration = Annotated[
    Path,
    typer.Argument(
        help="Calibration of the cameras: a file of OpenCV, EasyMocap, Pose2Sim, Anipose, VoxelPose or Panoptic, or a "
        "folder with a file for each camera.",
        metavar="CALIBRATION",
    ),
]
DetectionPaths = Annotated[
    list[Path],
    typer.Argument(
        help="Detections: a folder or file for each camera, or a folder that holds them. OpenPose folders, COCO and "
        "AlphaPose results, MMPose predictions, arrays of RTMLib, the folder [cyan]pose[/] of Pose2Sim.",
        metavar="DETECTIONS",
    ),
]
_FPS = 25.0


@dataclass(frozen=True)
class Inputs:
    """A recording that was read.

    Attributes:
        rig: its cameras, z up.
        frames: detections of each of the T frames, with the times of the pictures, all on one skeleton.
        numbers: number of each frame in the files, (T,).
        period: time between frames, seconds.
        paths: file or folder with the detections of each camera, V.
    """

    rig: Rig
    frames: list[Detections]
    numbers: NDArray[np.int64]
    period: float
    paths: tuple[Path, ...] = ()

    @property
    def skeleton(self) -> mvpose.Skeleton:
        """Skeleton of the detections."""
        from mvpose import COCO17

        return self.frames[0].skeleton if self.frames else COCO17


@dataclass(frozen=True)
class Choices:
    """Options of commands that read a recording, as given."""

    fps: Annotated[float | None, typer.Option(metavar="N", help="Frames per second. [dim]\\[default: 25][/]")] = None
    times: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Times of the pictures in seconds: a line for each frame, with one number, or one for each camera.",
        ),
    ] = None
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Size of the pictures in pixels, for calibrations that do not state it."),
    ] = None
    cameras: Annotated[
        str | None, typer.Option(metavar="NAME,...", help="Cameras of the calibration to use. [dim]\\[default: all][/]")
    ] = None
    frames: Annotated[
        str | None,
        typer.Option(metavar="FIRST:LAST", help="Frames to use, by the numbers in the files: [cyan]0:500[/]."),
    ] = None
    skeleton: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Skeleton of the detections, if their number of joints does not show it: coco17, body25, halpe26, "
            "wholebody133 ..., or a TOML file.",
        ),
    ] = None
    joints: Annotated[
        str,
        typer.Option(
            metavar="body|all",
            help="Joints to estimate: the 17 of COCO, or all of the detections, with hands, face, feet.",
        ),
    ] = "body"
    up: Annotated[
        str | None,
        typer.Option(
            metavar="AXIS",
            help="Axis of the calibration's world that points up: z, y, -y ... [dim]\\[default: z][/]",
        ),
    ] = None

    @property
    def only(self) -> tuple[str, ...]:
        """Names of the cameras to use; empty for all."""
        return tuple(name.strip() for name in self.cameras.split(",")) if self.cameras else ()


def read_inputs(calibration: Path, detections: Sequence[Path], choices: Choices, *, examined: bool = False) -> Inputs:
    """Read a calibration and detections, and check that they can belong together. Notes are printed on stderr.

    Args:
        calibration: file or folder.
        detections: files or folders.
        choices: options of the command.
        examined: whether the doctor looks at them next: what does not fit is then noted, not refused.

    Raises:
        ValueError: anything wrong with a file or an option.
    """
    from mvpose.commands.progress import single_stage
    from mvpose.formats.detections import plausibility
    from mvpose.formats.detections.recorded_frames import read_recording

    if choices.fps is not None and choices.times is not None:
        raise ValueError("--fps and --times: give one of them")
    if choices.joints not in ("body", "all"):
        raise ValueError(f"--joints must be body or all, got {choices.joints!r}")
    if choices.fps is not None and not 0.0 < choices.fps < 1e6:
        raise ValueError(f"--fps must be above 0, got {choices.fps}")
    frames, size = _frames(choices.frames), picture_size(choices.size)
    skeleton = _skeleton(choices.skeleton) if choices.skeleton else None
    rig = _read_rig(calibration, choices.only, examined=examined)
    names = [camera.name for camera in rig]
    with single_stage("read", len(rig)) as advance:
        recorded = read_recording(
            names, detections, skeleton=skeleton, all_joints=choices.joints == "all", frames=frames, progress=advance
        )
    note(recorded.assignment.text(names))
    extents = recorded.extents()
    rig, about_size = plausibility.with_sizes(rig, extents, size=size)
    if about_size:
        note(about_size)
    with _noted() if examined else contextlib.nullcontext():
        plausibility.check_principal_points(rig)
    with _noted() if examined else contextlib.nullcontext():
        plausibility.check_extents(rig, extents)
    if choices.up is not None:
        rig = plausibility.turned_up(rig, choices.up)
    elif not examined:
        plausibility.check_up(rig)
    times, period = _times(choices, recorded.numbers, len(rig))
    paths = tuple(source.path for source in recorded.assignment.sources)
    return Inputs(rig, recorded.detections(times), recorded.numbers, period, paths)


def _read_rig(path: Path, only: Sequence[str], *, examined: bool) -> Rig:
    """Read a calibration; for the doctor also one whose cameras make no rig, such as one in millimetres.

    Raises:
        ValueError: anything wrong with the file.
    """
    from mvpose import Rig
    from mvpose.camera import UnlikelyRigError
    from mvpose.formats.calibration.calibration_formats import read_calibration
    from mvpose.formats.detections.plausibility import UNKNOWN_SIZE

    try:
        return read_calibration(path, size=UNKNOWN_SIZE, only=only, key="--cameras")
    except ValueError as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, UnlikelyRigError):
            cause = cause.__context__
        if not examined or cause is None:
            raise
        note(str(cause))
        return Rig.unchecked([camera for camera in cause.cameras if not only or camera.name in only])


@contextlib.contextmanager
def _noted() -> Iterator[None]:
    """Print an error as a note."""
    try:
        yield
    except ValueError as error:
        note(str(error))


def _skeleton(given: str) -> JointNames:
    """Return the joints of a known skeleton, or of a TOML file."""
    from mvpose.formats.joint_names import JointNames, known_skeleton
    from mvpose.wholebody import read_skeleton, register

    if not given.lower().endswith(".toml"):
        return known_skeleton(given)
    skeleton = read_skeleton(given)
    register(skeleton)
    return JointNames(skeleton.name, skeleton.joints)


def _times(choices: Choices, numbers: NDArray[np.int64], cameras: int) -> tuple[NDArray[np.float64], float]:
    """Return the time of each picture, (T, V), seconds, and the time between frames."""
    import numpy as np

    if choices.times is not None:
        times = _read_times(choices.times, len(numbers), cameras)
        return times, float(np.median(np.diff(np.nanmean(times, axis=1)))) if len(times) > 1 else 1.0 / _FPS
    if choices.fps is None:
        note(f"no --fps: {_FPS:g} frames per second are assumed, which sets how fast people can move")
    period = 1.0 / (choices.fps or _FPS)
    return np.repeat((numbers * period)[:, None], cameras, axis=1), period


def _read_times(path: Path, frames: int, cameras: int) -> NDArray[np.float64]:
    """Read times of pictures, (T, V): lines of one number, or of one for each camera; a first line may hold names.

    Raises:
        ValueError: no such file, or another number of lines or of numbers in a line.
    """
    import re

    import numpy as np

    from mvpose.files.input_files import read_bytes

    text = read_bytes(path, what="times of pictures, a line for each frame").decode("utf-8", "replace")
    lines = [re.split(r"[,;\s]+", line.strip()) for line in text.splitlines() if line.strip()]
    if lines and any(re.search(r"[A-Za-z]", each) and each.lower() != "nan" for each in lines[0]):
        lines = lines[1:]
    try:
        values = [[float(each) if each else float("nan") for each in line] for line in lines]
    except ValueError as error:
        raise ValueError(f"{path}: {error}; expected times in seconds, a line for each frame") from None
    if len(values) != frames or any(len(line) not in (1, cameras) for line in values):
        widths = sorted({len(line) for line in values})
        raise ValueError(
            f"{path}: expected {frames} lines, one for each frame, of 1 or {cameras} numbers; got {len(values)} "
            f"lines of {', '.join(map(str, widths)) or 'no'} numbers"
        )
    times = np.array([line * (cameras if len(line) == 1 else 1) for line in values]).reshape(frames, cameras)
    of_frames = np.array([np.nanmean(row) if np.isfinite(row).any() else np.nan for row in times])
    if not np.isfinite(of_frames).all() or (np.diff(of_frames) <= 0).any():
        raise ValueError(f"{path}: the times of frames must be numbers of seconds that increase")
    return times


def _frames(given: str | None) -> tuple[int, int] | None:
    if given is None:
        return None
    first, _, last = given.partition(":")
    if not (first.strip().isdigit() and last.strip().isdigit() and int(first) <= int(last)):
        raise ValueError(f"--frames must be FIRST:LAST, such as 0:299, got {given!r}")
    return int(first), int(last)


def picture_size(given: str | None) -> tuple[int, int] | None:
    """Return the width and height of pictures, pixels, of the text of an option: "1920x1080"; None without a text.

    Raises:
        ValueError: not two whole numbers above 0.
    """
    if given is None:
        return None
    sides = given.lower().replace("×", "x").replace(",", "x").split("x")
    if len(sides) != 2 or not all(side.strip().isdigit() and 0 < int(side) < 10**6 for side in sides):
        raise ValueError(f"--size must be WIDTHxHEIGHT in pixels, such as 1920x1080, got {given!r}")
    return int(sides[0]), int(sides[1])
