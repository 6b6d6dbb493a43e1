"""Markers in a C3D file (https://www.c3d.org), the binary format of motion capture systems.

Points of the group POINT in the unit POINT:UNITS, with their labels; points with a negative residual are undefined. In
files that we write, millimetres, z up, the residual is the standard deviation of a point's error, the root mean square
over the axes, in whole millimetres up to 255, or 0 where it is unknown.
"""

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import one_line, prefixed, shown
from mvpose.formats.joint_names import JointNames, skeleton_of
from mvpose.formats.people import people_files
from mvpose.recording import People

_WHAT = "a C3D file of motion capture"
_OF_PERSON = re.compile(r"P(-?\d+):(.*)")  # labels of a file with several people
_MOST_TEXTS = 255  # of a parameter; the following ones are in LABELS2, LABELS3 and so on


def write(export: people_files.Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each person, from the first to the last frame in which it is present, or one file for all."""
    people, labels = export.uniform, [people_files.marker_label(joint) for joint in export.people.skeleton.joints]
    points = _points(people, export.axes("z"))
    screen = "+Y" if export.options.up == "y" else "+Z"
    if export.options.together:
        if people.frames and len(people):
            joined = [f"P{identity}:{label}" for identity in people.ids.tolist() for label in labels]
            yield "people.c3d", _file(points.reshape(people.frames, -1, 5), joined, people.rate, 1, screen)
        return
    for row, identity, span in people_files.each_person(people):
        content = _file(points[span, row], labels, people.rate, span.start + 1, screen)
        yield f"person_{identity}.c3d", content


def _points(people: People, axes: Floats) -> Floats:
    """Return x, y, z in millimetres, the residual and the unused mask of cameras of every joint, (T, n, J, 5)."""
    points = np.zeros((*people.joints.shape[:3], 5))
    points[..., :3] = np.nan_to_num(1000.0 * people.joints @ axes.T)
    if people.covariance is not None:
        variance = np.trace(people.covariance, axis1=-2, axis2=-1) / 3.0
        points[..., 3] = np.minimum(1000.0 * np.sqrt(np.maximum(np.nan_to_num(variance), 0.0)), 255.0)
    points[..., 3] = np.where(people.present, points[..., 3], -1.0)
    return points


def _file(points: Floats, labels: Sequence[str], rate: float, first: int, screen: str) -> bytes:
    """Return a file of points (T, k, 5)."""
    from c3d import Writer

    writer = Writer(point_rate=rate, point_units="mm")
    group = writer.point_group
    _set_texts(group, "LABELS", "Point labels.", labels)
    _set_texts(group, "DESCRIPTIONS", "Channel descriptions.", [" "] * len(labels))
    writer.set_screen_axis("+X", screen)
    writer.set_start_frame(first)
    frames = np.empty((len(points), 2), object)  # of points and analog signals, of which there are none
    for k, each in enumerate(points):
        frames[k, 0], frames[k, 1] = each, np.zeros((0, 0))
    writer.add_frames(frames)
    content = io.BytesIO()
    with warnings.catch_warnings():  # that there are no analog signals
        warnings.simplefilter("ignore")
        writer.write(content)
    return content.getvalue()


def _set_texts(group: Any, name: str, what: str, texts: Sequence[str]) -> None:
    """Set a parameter with a text for each point; the count of texts of one parameter is a byte of the file."""
    width = max(len(text) for text in texts)
    for part, start in enumerate(range(0, len(texts), _MOST_TEXTS), start=1):
        some = texts[start : start + _MOST_TEXTS]
        joined = "".join(text.ljust(width) for text in some)
        group.add_str(name + (str(part) if part > 1 else ""), what, joined, width, len(some))


def read(files: people_files.PeopleFiles) -> People:
    """Read the markers of one person from each file, or of all people from one file with labels such as ``P3:LHip``.

    The axis that points up is that of the files, of POINT:Y_SCREEN, or z.

    Raises:
        ValueError: a file is missing, truncated or no C3D file, has no points or points in an unknown unit, or other
            markers than the first file; or the package c3d is not installed.
    """
    return people_files.side_by_side([_read_file(path, files) for path in files.paths], files)


def _read_file(path: Path, files: people_files.PeopleFiles) -> People:
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
            unit, screen, rate = _text(reader, "UNITS"), _text(reader, "Y_SCREEN"), float(reader.point_rate)
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
    if unit not in people_files.METRES:
        raise ValueError(f"{path}: POINT:UNITS must be one of {', '.join(people_files.METRES)}, got {shown(unit)}")
    if not labels:
        raise ValueError(f"{path}: has no points; expected labelled markers (POINT:LABELS)")
    points = np.stack([each for _, each in frames]).astype(float)[:, : len(labels)]
    markers = people_files.METRES[unit] * np.where(points[..., 3:4] >= 0, points[..., :3], np.nan)
    axes = files.axes("y" if screen == "+y" else "z")
    numbers = int(frames[0][0]) + np.arange(len(frames))
    ids, names, joints = _by_person(path, labels, markers @ axes.T)
    with prefixed(path):
        times = files.times(numbers - 1, rate=rate)
        people = np.array(ids), joints
        return People(times, *people, skeleton=skeleton_of(JointNames(path.name, names)), numbers=numbers)


def _by_person(path: Path, labels: tuple[str, ...], markers: Floats) -> tuple[list[int], tuple[str, ...], Floats]:
    """Return identities (n,), names of joints and joints (T, n, J, 3) of labelled markers (T, k, 3)."""
    found = [_OF_PERSON.fullmatch(label) for label in labels]
    ids = list(dict.fromkeys(int(each[1]) for each in found if each))
    names = tuple(each[2] for each in found if each and int(each[1]) == ids[0])
    if list(labels) != [f"P{identity}:{name}" for identity in ids for name in names]:
        return [people_files.identity_of(path)], labels, markers[:, None]
    return ids, names, markers.reshape(len(markers), len(ids), len(names), 3)


def _text(reader: Any, name: str) -> str:
    stated = reader.get(f"POINT:{name}")
    return "" if stated is None else str(stated.string_value).strip("\0 ").lower()
