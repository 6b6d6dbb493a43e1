"""Markers of one person in a TRC file, the text format of Motion Analysis, OpenSim and Pose2Sim.

Five lines of header, the third of which names the markers, then a line for each frame: its number, its time, and x, y,
z of every marker in the unit of the header, separated by tabs. An empty cell is an undefined coordinate.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.input_files import read_bytes
from simharness.formats.joint_tracks import METRES, UP, JointTracks, TrackFiles, joined

_WHAT = "a TRC file: a header with Units, a line 'Frame# Time MARKER ...', and a line for each frame"


def read_tracks(files: TrackFiles) -> JointTracks:
    """Read the markers of one person from each file, (n, P, J, 3).

    Frame numbers are those of the column ``Frame#``; they only count the lines where they begin at 0 or 1.

    Raises:
        ValueError: a file is missing or of another layout, has a marker in an unknown unit, or other markers than the
            first file.
    """
    return joined([_read_person(path, UP[files.up]) for path in files.paths], files.paths)


def _read_person(path: Path, axes: Floats) -> JointTracks:
    lines = read_bytes(path, what=_WHAT).decode("utf-8-sig", errors="replace").splitlines()
    header = next((row for row, line in enumerate(lines) if line.lower().startswith("frame#")), None)
    if header is None or header < 2:
        raise ValueError(f"{path}: no line that begins with Frame#; expected {_WHAT}")
    names = tuple(cell.strip() for cell in lines[header].split("\t")[2:] if cell.strip())
    if not names:
        raise ValueError(f"{path}: no marker behind Frame# and Time; expected {_WHAT}, separated by tabs")
    metres = _metres(path, lines[:header])
    numbers, values = [], []
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
        values.append(found + [np.nan] * (3 * len(names) - len(found)))
    if not values:
        raise ValueError(f"{path}: has no frames; expected {_WHAT}")
    markers = metres * np.array(values).reshape(-1, len(names), 3)
    markers[~np.isfinite(markers).all(axis=-1)] = np.nan
    try:
        return JointTracks(np.array(numbers), (markers @ axes.T)[:, None], names, counted=numbers[0] in (0, 1))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _metres(path: Path, header: list[str]) -> float:
    """Return the metres per unit that the header states: the value below the word Units."""
    for keys, values in itertools.pairwise(header):
        columns = [cell.strip().lower() for cell in keys.split("\t")]
        if "units" in columns:
            cells = [cell.strip().lower() for cell in values.split("\t")]
            unit = dict(zip(columns, cells, strict=False)).get("units", "")
            if unit in METRES:
                return METRES[unit]
            raise ValueError(f"{path}: Units must be one of {', '.join(METRES)}, got {unit!r}")
    raise ValueError(f"{path}: the header has no Units; expected {_WHAT}")
