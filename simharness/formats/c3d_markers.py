"""Markers of one person in a C3D file (https://www.c3d.org), the binary format of motion capture systems.

Points of the group POINT in the unit POINT:UNITS, with their labels; points with a negative residual are undefined.
"""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import one_line, shown
from simharness.formats.joint_tracks import METRES, UP, JointTracks, TrackFiles, joined

_WHAT = "a C3D file of motion capture"


def read_tracks(files: TrackFiles) -> JointTracks:
    """Read the markers of one person from each file, (n, P, J, 3).

    Frame numbers are those of the header; they only count the frames where they begin at 0 or 1.

    Raises:
        ValueError: a file is missing, truncated or no C3D file, has no points or points in an unknown unit, or other
            markers than the first file; or the package c3d is not installed.
    """
    return joined([_read_person(path, UP[files.up]) for path in files.paths], files.paths)


def _read_person(path: Path, axes: Floats) -> JointTracks:
    try:
        from c3d import Reader
    except ImportError:
        raise ValueError(f"{path}: needs the package c3d, which is not installed; pip install c3d") from None

    content = read_bytes(path, what=_WHAT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = Reader(io.BytesIO(content))
            frames = [(number, points) for number, points, _ in reader.read_frames()]
            labels = tuple(str(label).strip() for label in reader.point_labels[: reader.point_used])
            stated = reader.get("POINT:UNITS")
            unit = "" if stated is None else str(stated.string_value).strip("\0 ").lower()
    except Exception as error:  # the package raises many types of errors on damaged files
        why = one_line(f"{type(error).__name__}: {error}", 160)
        raise ValueError(
            f"{path}: cannot be read as C3D ({why}; it has {len(content)} bytes); expected {_WHAT}"
        ) from None
    if len(frames) != reader.last_frame - reader.first_frame + 1:
        raise ValueError(
            f"{path}: expected frames {reader.first_frame} to {reader.last_frame}, got {len(frames)} frames; it was "
            "probably cut off: copy it again"
        )
    if unit not in METRES:
        raise ValueError(f"{path}: POINT:UNITS must be one of {', '.join(METRES)}, got {shown(unit)}")
    if not labels:
        raise ValueError(f"{path}: has no points; expected labelled markers (POINT:LABELS)")
    points = np.stack([each for _, each in frames]).astype(float)[:, : len(labels)]
    markers = METRES[unit] * np.where(points[..., 3:4] >= 0, points[..., :3], np.nan)
    first = int(frames[0][0])
    numbers = first + np.arange(len(frames))
    return JointTracks(numbers, (markers @ axes.T)[:, None], labels, counted=first in (0, 1))
