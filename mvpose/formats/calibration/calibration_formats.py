"""Registry of calibration formats: reads a file of any of them, whichever its name is.

To add a format, write one module and register it once:

1. a module beside this one with a function ``read(path, *, size, only) -> Rig`` of at least two cameras
   (:mod:`.voxelpose` is an example; :mod:`.camera_entry` converts the numbers of one camera, with messages that name
   it), and a constant ``FORMAT``, a :class:`~mvpose.formats.calibration.calibration_file.CalibrationFormat`. Its
   ``recognises`` looks at the content: ``lambda file: "my_cameras" in (file.json or {})``, or at ``file.content``, the
   bytes of a text file;
2. ``FORMAT`` in the list :data:`FORMATS` below, before more general formats. Programs that use mvpose as a library
   call :func:`register` instead.

Readers convert to our conventions: metres, z up, ``x_cam = R x + t``, OpenCV's camera axes.
"""

import difflib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mvpose import Camera, Rig
from mvpose.camera import UnlikelyRigError
from mvpose.files.message_text import one_line
from mvpose.formats.calibration import caliscope, colmap, easymocap, opencv, panoptic, pose2sim, qualisys, voxelpose
from mvpose.formats.calibration.calibration_file import CalibrationFile, CalibrationFormat
from mvpose.formats.calibration.camera_folder import only_file, read_folder, suffix_of, unit_of, write_folder

FORMATS: list[CalibrationFormat] = [
    panoptic.FORMAT,
    voxelpose.FORMAT,
    qualisys.FORMAT,
    easymocap.FORMAT,
    pose2sim.FORMAT,
    colmap.FORMAT,
    caliscope.FORMAT,
    opencv.FORMAT,  # after EasyMocap and Pose2Sim, which write the same kinds of files: it takes the rest
]
"""Registered formats; the first that recognises a file reads it."""


def check_writable(original: str | Path) -> None:
    """Check that a rig can be written in the format of a calibration.

    Raises:
        ValueError: an unknown format, or one that can only be read.
    """
    _writer_of(original)


def write_like(original: str | Path, path: str | Path, rig: Rig) -> None:
    """Write a rig in the format of another calibration.

    Args:
        original: a calibration of any registered format.
        path: the file to write; of formats in two files either of them; a folder where the original is one.
        rig: the cameras.

    Raises:
        ValueError: an unknown or read-only format, or a rig that it cannot hold.
        OSError: the file cannot be written.
    """
    place, write = _writer_of(original)
    if write is None:
        Path(path).mkdir(parents=True, exist_ok=True)
        write_folder(Path(path), rig, suffix=suffix_of(place))
    else:
        target = Path(path) / place.name if Path(original).is_dir() else Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        write(target, rig)


def _writer_of(original: str | Path) -> tuple[Path, Callable[[Path, Rig], None] | None]:
    """Return the file or folder of a calibration, and what writes its format; None for a file for each camera.

    Raises:
        ValueError: an unknown format, or one that can only be read.
    """
    place, chosen = _format_of(Path(original))
    if chosen is not None and chosen.write is None:
        raise ValueError(f"{original}: calibrations of {chosen.name} can be read, but not written")
    return place, None if chosen is None else chosen.write


def _format_of(path: Path) -> tuple[Path, CalibrationFormat | None]:
    """Return the file or folder of a calibration, and its format; None for a folder with a file for each camera.

    Raises:
        ValueError: no such file, or no registered format recognises it.
    """
    place = path
    if path.is_dir():
        found = only_file(path)
        if found is None or found.is_dir():
            return found or path, None
        place = found
    known = ", ".join(each.name for each in FORMATS)
    file = CalibrationFile(place, f"a camera calibration: {known}")
    chosen = next((each for each in FORMATS if each.recognises(file)), None)
    if file.json == {}:
        of_json = ", ".join(each.name for each in FORMATS if "JSON" in each.name)
        raise ValueError(f"{place}: an empty object, without cameras; expected a camera calibration: {of_json}")
    if chosen is None:
        raise ValueError(f"{place}: not a known calibration: found {file.summary}; expected one of {known}")
    return place, chosen


def register(added: CalibrationFormat) -> None:
    """Register a format; it is tried before those that are registered already."""
    FORMATS.insert(0, added)


def read_calibration(
    path: str | Path,
    *,
    size: tuple[int, int],
    only: Sequence[str] = (),
    key: str = "cameras.only",
    unit: str | None = None,
) -> Rig:
    """Read a calibration file of any registered format.

    Args:
        path: the file; of formats in two files (EasyMocap, a stereo pair of OpenCV) either of them; or a folder with
            a file for each camera, or with one file.
        size: width and height of the images in pixels, for files that do not hold them (VoxelPose, and some files of
            EasyMocap and OpenCV).
        only: names of the cameras to take, in this order; empty: all (of Panoptic: the HD cameras).
        key: key of a file that holds these names, for messages.
        unit: unit of its lengths, in :data:`UNITS`, for files of formats that prescribe none; None: metres.

    Raises:
        ValueError: the file does not exist, no registered format recognises it, its reader finds a fault, or it is in
            another unit; every message names the file.
    """
    try:
        place, chosen = _format_of(Path(path))
        scale = 1.0 if unit is None else _scale(unit, path, unit_of(place) if chosen is None else chosen.unit)
        with np.errstate(over="ignore", invalid="ignore"):  # of values that the cameras refuse
            rig = (read_folder if chosen is None else chosen.read)(place, size=size, only=only)
    except ValueError as error:
        if (unlikely := unlikely_rig(error)) is None or unit is None:
            raise ValueError(one_line(str(error), _MESSAGE)) from None
        rig = Rig.unchecked(unlikely.cameras)
    try:
        if unit is not None:
            rig = Rig([replace(camera, t=scale * camera.t) for camera in rig])
        return select(rig, only, key=key)
    except ValueError as error:
        raise ValueError(one_line(f"{path}: {error}")) from None


def unlikely_rig(error: ValueError) -> UnlikelyRigError | None:
    """Return the error about where cameras stand from which the error of a reader comes; None for another one."""
    cause: BaseException | None = error
    while cause is not None and not isinstance(cause, UnlikelyRigError):
        cause = cause.__context__
    return cause


def _scale(unit: str, path: str | Path, prescribed: str) -> float:
    """Return by how much lengths that were read are to be multiplied, given their unit."""
    if unit not in UNITS:
        raise ValueError(f"--unit must be one of {', '.join(UNITS)}, got {unit!r}")
    if prescribed not in ("", unit):
        raise ValueError(f"--unit {unit}: files such as {path} are in {prescribed}, which is read so; leave --unit out")
    return 1.0 if prescribed else UNITS[unit]


UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
"""Metres of the units of lengths."""

_SHOWN = 12  # names that a message repeats
_MESSAGE = 700  # letters: all formats are in one message


def select(cameras: Sequence[Camera] | Rig, only: Sequence[str], *, key: str = "cameras.only") -> Rig:
    """Return the rig of the cameras named in ``only``, in that order; of all cameras where ``only`` is empty.

    ``key`` is the key that holds the names, for messages.

    Raises:
        ValueError: a name that no camera has, a name given twice, or fewer than two names.
    """
    if not only:
        return Rig(list(cameras))
    by_name = {camera.name: camera for camera in cameras}
    for name in only:
        if name not in by_name:
            near = difflib.get_close_matches(name, by_name, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            known = ", ".join(list(by_name)[:_SHOWN]) + (", ..." if len(by_name) > _SHOWN else "")
            raise ValueError(f"{key}: the rig has no camera {name!r}; {hint}its {len(by_name)} cameras are {known}")
        if list(only).count(name) > 1:
            raise ValueError(f"{key}: {name!r} is given more than once; remove the repetition")
    if len(only) < 2:
        raise ValueError(f"{key}: expected at least 2 cameras, to triangulate, got {len(only)}")
    return Rig([by_name[name] for name in only])
