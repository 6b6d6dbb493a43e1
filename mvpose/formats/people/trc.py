"""Markers of one person in a TRC file, the text format of Motion Analysis that OpenSim and Pose2Sim read and write.

Five lines of header, the third of which names the markers, then a line for each frame: its number, its time, and x, y,
z of every marker in the unit of the header, separated by tabs. An empty cell is an undefined coordinate. Files that we
write have the frames from the first to the last in which the person is present, numbered from 1, and a tab behind every
cell, as files of OpenSim, whose reader would not see an empty last cell otherwise (``OpenSim/Common/FileAdapter.cpp``).
"""

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import prefixed
from mvpose.formats.joint_names import JointNames, skeleton_of
from mvpose.formats.people import people_files
from mvpose.recording import People

_KEYS = (
    "DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate", "OrigDataStartFrame", "OrigNumFrames",
)  # fmt: skip
_DECIMALS = {"m": 6, "mm": 3}  # micrometres
_WHAT = "a TRC file: a header with Units, a line 'Frame# Time MARKER ...', and a line for each frame"


def write(export: people_files.Export) -> Iterator[tuple[str, bytes]]:
    """Yield a file for each person; y up and metres unless the options say otherwise."""
    people, unit = export.uniform, export.options.units
    markers = people.joints @ export.axes("y").T * {"m": 1.0, "mm": 1000.0}[unit]
    labels = [people_files.marker_label(joint) for joint in people.skeleton.joints]
    for row, identity, span in people_files.each_person(people):
        name = f"person_{identity}.trc"
        first, count, rate = span.start + 1, span.stop - span.start, f"{people.rate:.6f}"
        values = (rate, rate, str(count), str(len(labels)), unit, rate, str(first), str(count))
        lines = [
            f"PathFileType\t4\t(X/Y/Z)\t{name}",
            "\t".join(_KEYS),
            "\t".join(values),
            "Frame#\tTime\t" + "".join(f"{label}\t\t\t" for label in labels),
            "\t\t" + "".join(f"X{k}\tY{k}\tZ{k}\t" for k in range(1, len(labels) + 1)),
        ]
        cell = f"%.{_DECIMALS[unit]}f\t"
        for frame in range(span.start, span.stop):
            pose = markers[frame, row].ravel()
            cells = "".join("\t" if missing else cell % x for x, missing in zip(pose, np.isnan(pose), strict=True))
            lines.append(f"{frame + 1}\t{people.times[frame]:.6f}\t{cells}")
        yield name, ("\n".join(lines) + "\n").encode()


def read(files: people_files.PeopleFiles) -> People:
    """Read the markers of one person from each file; y up unless the declared axis is z.

    Raises:
        ValueError: a file is missing or of another layout, has a marker in an unknown unit, or other markers than the
            first file.
    """
    return people_files.side_by_side([_read_person(path, files) for path in files.paths], files)


def _read_person(path: Path, files: people_files.PeopleFiles) -> People:
    lines = read_bytes(path, what=_WHAT).decode("utf-8-sig", errors="replace").splitlines()
    header = next((row for row, line in enumerate(lines) if line.lower().startswith("frame#")), None)
    if header is None or header < 2:
        raise ValueError(f"{path}: no line that begins with Frame#; expected {_WHAT}")
    names = tuple(cell.strip() for cell in lines[header].split("\t")[2:] if cell.strip())
    if not names:
        raise ValueError(f"{path}: no marker behind Frame# and Time; expected {_WHAT}, separated by tabs")
    metres, rate = _units_and_rate(path, lines[:header])
    numbers, times, values = [], [], []
    for row, line in enumerate(lines[header + 1 :], start=header + 2):
        cells = [cell.strip() for cell in line.split("\t")]
        if not cells[0]:  # the line X1 Y1 Z1 ..., and empty lines
            continue
        try:
            found = [float(cell) if cell else np.nan for cell in cells[2 : 2 + 3 * len(names)]]
            numbers.append(int(float(cells[0])))
        except (ValueError, OverflowError):  # an infinite frame number
            raise ValueError(f"{path}, line {row}: expected numbers, got {line[:60]!r}") from None
        if any(cells[2 + 3 * len(names) :]):
            raise ValueError(
                f"{path}, line {row}: expected {3 * len(names)} coordinates of {len(names)} markers, got "
                f"{len(cells) - 2}"
            )
        times.append(_number(cells[1]) if len(cells) > 1 else np.nan)
        values.append(found + [np.nan] * (3 * len(names) - len(found)))
    if not values:
        raise ValueError(f"{path}: has no frames; expected {_WHAT}")
    markers = metres * np.array(values).reshape(-1, len(names), 3)
    markers[~np.isfinite(markers).all(axis=-1)] = np.nan
    with prefixed(path):
        return People(
            files.times(np.array(numbers), times, rate=rate),
            np.array([people_files.identity_of(path)]),
            (markers @ files.axes("y").T)[:, None],
            skeleton=skeleton_of(JointNames(path.name, names)),
            numbers=np.array(numbers),
        )


def _units_and_rate(path: Path, header: list[str]) -> tuple[float, float]:
    """Return the metres per unit and the frames per second (NaN: none) below the words of a header."""
    for keys, values in itertools.pairwise(header):
        columns = [cell.strip().lower() for cell in keys.split("\t")]
        if "units" in columns:
            cells = dict(zip(columns, [cell.strip().lower() for cell in values.split("\t")], strict=False))
            unit = cells.get("units", "")
            if unit in people_files.METRES:
                return people_files.METRES[unit], _number(cells.get("datarate", ""))
            raise ValueError(f"{path}: Units must be one of {', '.join(people_files.METRES)}, got {unit!r}")
    raise ValueError(f"{path}: the header has no Units; expected {_WHAT}")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
