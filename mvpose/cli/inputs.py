"""Calibration and detections of a recording, read and checked: the first step of every command about one."""

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mvpose.commands.option_groups import given, option
from mvpose.commands.programs import note

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    import mvpose
    from mvpose import Detections, Rig
    from mvpose.cli.synchronisation import Synchronised
    from mvpose.formats.joint_names import JointNames
    from mvpose.formats.pictures import PictureSource
    from mvpose.formats.pose2sim_project import ProjectSettings

Calibration = Annotated[
    Path,
    typer.Argument(
        help="Calibration of the cameras: a file of OpenCV, EasyMocap, Pose2Sim, Anipose, caliscope, "
        "COLMAP, Qualisys, VoxelPose or Panoptic, or a "
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
    """A recording that was read."""

    rig: "Rig"
    """Its cameras, z up."""
    frames: "Sequence[Detections]"
    """Detections of each of the T frames, with the times of the pictures, all on one skeleton."""
    numbers: "NDArray[np.int64]"
    """Number of each frame in the files, (T,)."""
    period: float
    """Time between frames, seconds."""
    paths: tuple[Path, ...] = ()
    """File or folder with the detections of each camera, V."""
    doubt: str = ""
    """Why the given upward axis may be wrong; "" where nothing speaks against it."""
    whole: bool = True
    """Whether these are all frames of the detections."""
    synchronised: "Synchronised | None" = None
    """Starts of cameras that began to record at different moments; None: frames of one number are of one moment."""
    digest: str = ""
    """Text that changes with anything in cameras, detections and times."""

    def pictures(self, view: int) -> "NDArray[np.int64]":
        """Return the number of the picture of a camera in each frame, (T,)."""
        return self.numbers if self.synchronised is None else self.synchronised.pictures[:, view]

    def select(self, rows: "NDArray[np.int64]") -> "Inputs":
        """Return some frames."""
        found = self.synchronised and replace(self.synchronised, pictures=self.synchronised.pictures[rows])
        frames = [self.frames[row] for row in rows.tolist()]
        return replace(self, frames=frames, numbers=self.numbers[rows], synchronised=found)

    @property
    def long(self) -> bool:
        """Whether the recording is too long to be kept in memory."""
        from mvpose.formats.detections import recorded_frames

        return len(self.frames) > recorded_frames.IN_MEMORY

    @property
    def skeleton(self) -> "mvpose.Skeleton":
        """Skeleton of the detections."""
        from mvpose import COCO17

        return self.frames[0].skeleton if self.frames else COCO17


PATH, OF_DETECTIONS = "path", "of detections"
"""Marks of options whose values may be paths, and of those that detections alone need, which ``mvpose run`` makes."""


@dataclass(frozen=True)
class Choices:
    """Options of commands that read a recording, as given."""

    fps: float | None = option(None, "Frames per second. [dim]\\[default: 25][/]", metavar="N")
    times: Path | None = option(
        None,
        "Times of the pictures in seconds: a line for each frame, with one number, or one for each camera.",
        marks=(PATH, OF_DETECTIONS),
        metavar="FILE",
    )
    sync: bool = option(
        False,
        "The cameras began to record at different moments: find these from the people, up to 10 s apart.",
        "--sync",
    )
    rates: str | None = option(
        None, "Frames per second of each camera, where they differ; with --sync.", metavar="N,N,..."
    )
    size: str | None = option(
        None, "Size of the pictures in pixels, for calibrations that do not state it.", metavar="WxH"
    )
    cameras: str | None = option(
        None, "Cameras of the calibration to use. [dim]\\[default: all][/]", metavar="NAME,..."
    )
    frames: str | None = option(
        None, "Frames to use, by the numbers in the files: [cyan]0:500[/].", metavar="FIRST:LAST"
    )
    skeleton: str | None = option(
        None,
        "Skeleton of the detections, if their number of joints does not show it: coco17, body25, halpe26, "
        "wholebody133 ..., or a TOML file.",
        marks=(PATH, OF_DETECTIONS),
        metavar="NAME",
    )
    joints: str = option(
        "body",
        "Joints to estimate: the 17 of COCO, or all of the detections, with hands, face, feet.",
        metavar="body|all",
    )
    unit: str | None = option(
        None,
        "Unit of the calibration's lengths, for formats that do not fix it: m, cm, mm. [dim]\\[default: m][/]",
        metavar="UNIT",
    )
    up: str | None = option(
        None, "Axis of the calibration's world that points up: z, y, -y ... [dim]\\[default: z][/]", metavar="AXIS"
    )

    @property
    def only(self) -> tuple[str, ...]:
        """Names of the cameras to use; empty for all."""
        return tuple(name.strip() for name in self.cameras.split(",")) if self.cameras else ()

    def check(self) -> None:
        """Check what does not depend on files.

        Raises:
            ValueError: an option that cannot be, or two that exclude each other.
        """
        if self.fps is not None and self.times is not None:
            raise ValueError("--fps and --times: give one of them")
        if self.sync and self.times is not None:
            raise ValueError("--sync and --times: give one of them; --sync finds the times of the pictures")
        if self.rates is not None and not self.sync:
            raise ValueError("--rates: give --sync as well; without it, all cameras take a picture in every frame")
        if self.rates is not None and self.fps is not None:
            raise ValueError("--fps and --rates: give one of them")
        if self.joints not in ("body", "all"):
            raise ValueError(f"--joints must be body or all, got {self.joints!r}")
        if self.fps is not None and not 0.0 < self.fps < 1e6:
            raise ValueError(f"--fps must be above 0, got {self.fps}")


def with_rates(choices: Choices, sources: "Sequence[PictureSource]") -> Choices:
    """Return options with the rate of the pictures, or those of each camera, where nothing else states them.

    Args:
        choices: options about the recording.
        sources: pictures of each camera, in the order of the calibration.

    Raises:
        ValueError: different rates of cameras that began at one moment.
    """
    from mvpose.cli.camera_pictures import common_rate

    if choices.fps or choices.rates:
        return choices
    rates = [source.fps for source in sources]
    if choices.sync and all(map(math.isfinite, rates)):
        return replace(choices, rates=",".join(f"{rate:.9g}" for rate in rates))
    return replace(choices, fps=common_rate(sources))


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

    choices.check()
    frames, size = _frames(choices.frames), picture_size(choices.size)
    skeleton, origin, project = _skeleton(choices.skeleton) if choices.skeleton else None, "", _project(detections)
    if skeleton is None:
        with _noted():
            skeleton, origin = project.skeleton()
    if frames is None:
        frames, place = project.frames()
        if frames is not None:
            note(f"frames {frames[0]} to {frames[1]}: {place}; --frames goes before it", usual=True)
    rig = _read_rig(calibration, choices, size, examined=examined)
    unsized = any(camera.size == plausibility.UNKNOWN_SIZE for camera in rig)
    names = [camera.name for camera in rig]
    with single_stage("read", len(rig)) as advance:
        recorded = read_recording(
            names,
            detections,
            skeleton=skeleton,
            origin=origin,
            all_joints=choices.joints == "all",
            frames=None if choices.sync else frames,
            apart=choices.sync,
            progress=advance,
        )
    note(recorded.assignment.text(names), usual=recorded.assignment.by_name)
    for each in recorded.notes:
        note(each, usual=True)
    extents = recorded.extents()
    rig, about_size = plausibility.with_sizes(rig, extents)
    if about_size:
        note(about_size)
    if unsized:
        with _noted() if examined else contextlib.nullcontext():
            plausibility.check_principal_points(rig)
    with _noted() if examined else contextlib.nullcontext():
        plausibility.check_extents(rig, extents)
    doubt = "" if choices.up is None else doubt_about(rig, choices.up)
    if choices.up is not None:
        if doubt:
            note(doubt)
        rig = plausibility.turned_up(rig, choices.up)
    found, numbers = None, recorded.numbers
    if choices.sync:
        from mvpose.cli.synchronisation import rates_of, synchronised

        period = 1.0 if choices.rates is not None else _times(choices, numbers, names, project)[1]
        found = synchronised(rig, recorded, rates_of(choices.rates, names, 1.0 / period), frames)
        recorded, times, period = found.recorded, found.times, found.period
        note(found.text(names))
    else:
        times, period = _times(choices, numbers, names, project)
    paths = tuple(source.path for source in recorded.assignment.sources)
    digest = recorded.digest(rig.packed, times)
    return Inputs(
        rig, recorded.detections(times), recorded.numbers, period, paths, doubt, frames is None, found, digest
    )


def doubt_about(rig: "Rig", up: str) -> str:
    """Return why the given upward axis of a calibration's world may be wrong; "" where nothing speaks against it."""
    from mvpose.formats.detections.plausibility import up_axis

    stands = up_axis(rig)
    right = stands in (None, up)
    return "" if right else f"--up={up}: the cameras stand upright where the {stands} axis of the world points up"


def _read_rig(path: Path, choices: Choices, size: tuple[int, int] | None, *, examined: bool) -> "Rig":
    """Read a calibration, and judge it before detections are read, which may take minutes.

    For the doctor, also one whose cameras make no rig, such as one in millimetres, is read.

    Raises:
        ValueError: anything wrong with the file.
    """
    import numpy as np

    from mvpose import Rig
    from mvpose.formats.calibration.calibration_formats import read_calibration, unlikely_rig
    from mvpose.formats.detections import plausibility

    only, unknown = choices.only, plausibility.UNKNOWN_SIZE
    try:
        rig = read_calibration(path, size=unknown, only=only, key="--cameras", unit=choices.unit)
    except ValueError as error:
        if not examined or (unlikely := unlikely_rig(error)) is None:
            raise
        note(str(unlikely))
        rig = Rig.unchecked([camera for camera in unlikely.cameras if not only or camera.name in only])
    if size is not None:
        with _noted() if examined else contextlib.nullcontext():
            plausibility.check_size(rig, size)
            if given("size") and all(camera.size == size for camera in rig):
                note("--size has no effect: the calibration states the same")
        rig, _ = plausibility.with_sizes(rig, np.empty((0, 2, 2)), size=size)
    if all(camera.size != unknown for camera in rig):
        with _noted() if examined else contextlib.nullcontext():
            plausibility.check_principal_points(rig)
    if choices.up is None and not examined:
        plausibility.check_up(rig)
    return rig


@contextlib.contextmanager
def _noted() -> Iterator[None]:
    """Print an error as a note."""
    try:
        yield
    except ValueError as error:
        note(str(error))


def _project(detections: Sequence[Path]) -> "ProjectSettings":
    """Return the settings of the Pose2Sim project in which detections lie."""
    from mvpose.formats.detections.sources import find_sources
    from mvpose.formats.pose2sim_project import ProjectSettings

    return ProjectSettings.near(source.path for source in find_sources(detections))


def _skeleton(given: str) -> "JointNames":
    """Return the joints of a known skeleton, or of a TOML file."""
    from mvpose.formats.joint_names import JointNames, known_skeleton
    from mvpose.wholebody import read_skeleton, register

    if not given.lower().endswith(".toml"):
        return known_skeleton(given)
    skeleton = read_skeleton(given)
    register(skeleton)
    return JointNames(skeleton.name, skeleton.joints)


def _times(
    choices: Choices, numbers: "NDArray[np.int64]", cameras: Sequence[str], project: "ProjectSettings"
) -> "tuple[NDArray[np.float64], float]":
    """Return the time of each picture, (T, V), seconds, and the time between frames."""
    import numpy as np

    from mvpose.formats.times_file import read_times

    if choices.times is not None:
        times, remark = read_times(choices.times, len(numbers), cameras)
        if remark:
            note(remark)
        return times, float(np.median(np.diff(np.nanmean(times, axis=1)))) if len(times) > 1 else 1.0 / _FPS
    rate, origin = (choices.fps, "") if choices.fps is not None else _project_rate(project)
    if origin:
        note(f"{rate:g} frames per second: {origin}; --fps goes before it", usual=True)
    elif rate is None:
        note(f"no --fps: {_FPS:g} frames per second are assumed, which sets how fast people can move")
    period = 1.0 / (rate or _FPS)
    return np.repeat((numbers * period)[:, None], len(cameras), axis=1), period


def _project_rate(project: "ProjectSettings") -> tuple[float | None, str]:
    """Return the frames per second of a project, of its settings or its videos, and where they are stated."""
    rate, origin = project.rate()
    folders = [file.parent / "videos" for file in project.files if (file.parent / "videos").is_dir()]
    if rate is None and folders:
        from mvpose.cli.camera_pictures import common_rate, open_videos

        with _noted():
            rate = common_rate(open_videos(folders[:1]))
            origin = f"of the videos in {folders[0]}"
    return rate, origin if rate is not None else ""


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
