"""Registry of calibration formats: reads a file of any of them, whichever its name is.

To add a format, write one module and register it once:

1. a module beside this one with a function ``read(path, *, size, only) -> Rig`` of at least two cameras
   (:mod:`.voxelpose` is an example; :mod:`.entries` converts the numbers of one camera, with messages that name it),
   and a constant ``FORMAT``, a :class:`~mvpose.formats.calibration.calibration_format.CalibrationFormat`. Its
   ``recognises`` looks at the content: ``lambda file: "my_cameras" in (file.json or {})``, or at ``file.content``, the
   bytes of a text file;
2. ``FORMAT`` in the list :data:`FORMATS` below, before more general formats. Programs that use mvpose as a library
   call :func:`register` instead.

Readers convert to our conventions: metres, z up, ``x_cam = R x + t``, OpenCV's camera axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mvpose import Rig
from mvpose.files.message_text import one_line
from mvpose.formats.calibration import easymocap, opencv, panoptic, pose2sim, voxelpose
from mvpose.formats.calibration.calibration_format import CalibrationFile, CalibrationFormat
from mvpose.formats.calibration.selection import select

FORMATS: list[CalibrationFormat] = [
    panoptic.FORMAT,
    voxelpose.FORMAT,
    easymocap.FORMAT,
    opencv.FORMAT,  # after EasyMocap, which writes the same kind of file: it takes the rest
    pose2sim.FORMAT,
]
"""Registered formats; the first that recognises a file reads it."""


def register(added: CalibrationFormat) -> None:
    """Register a format; it is tried before those that are registered already."""
    FORMATS.insert(0, added)


def read_calibration(
    path: str | Path, *, size: tuple[int, int], only: Sequence[str] = (), key: str = "cameras.only"
) -> Rig:
    """Read a calibration file of any registered format.

    Args:
        path: the file; of formats in two files (EasyMocap, a stereo pair of OpenCV) either of them.
        size: width and height of the images in pixels, for files that do not hold them (VoxelPose, and some files of
            EasyMocap and OpenCV).
        only: names of the cameras to take, in this order; empty: all (of Panoptic: the HD cameras).
        key: key of a file that holds these names, for messages.

    Raises:
        ValueError: the file does not exist, no registered format recognises it, or its reader finds a fault; every
            message names the file.
    """
    file = CalibrationFile(Path(path), f"a camera calibration: {', '.join(each.name for each in FORMATS)}")
    chosen = next((each for each in FORMATS if each.recognises(file)), None)
    if chosen is None:
        known = "; ".join(f"{each.name}: {one_line(each.expects, 30)}" for each in FORMATS)
        raise ValueError(one_line(f"{path}: not a known calibration: found {file.summary}; expected one of {known}"))
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # of values that the cameras refuse
            rig = chosen.read(file.path, size=size, only=only)
    except ValueError as error:
        raise ValueError(one_line(str(error))) from None
    try:
        return select(rig, only, key=key)
    except ValueError as error:
        raise ValueError(one_line(f"{path}: {error}")) from None
