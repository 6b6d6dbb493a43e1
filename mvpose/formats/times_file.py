"""Times of pictures in text files: a line for each frame, with one number or one for each camera, seconds.

A first line may name the columns. Then those of the cameras are taken, in whichever order, or the only one that
is called a time; other columns, such as the number of the frame, are left out.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mvpose.arrays import Floats
from mvpose.files.input_files import read_bytes
from mvpose.files.message_text import listed, prefixed
from mvpose.formats.joint_names import canonical

_TIMES = ("t", "s", "time", "times", "timestamp", "timestamps", "seconds", "time_s", "time_seconds")
_SLOWEST, _FASTEST = 1.0, 1e-4  # s between frames: from time lapses, which are not followed, to 10,000 a second


def read_times(path: Path, frames: int, cameras: Sequence[str]) -> tuple[Floats, str]:
    """Read times of pictures.

    Args:
        path: the file.
        frames: number of frames, T.
        cameras: names of the V cameras.

    Returns:
        The times, (T, V), seconds, NaN where a line has "nan"; and what the first line decided, for the user.

    Raises:
        ValueError: no such file, another number of lines or of numbers in a line, names that are not those of the
            cameras, times that do not increase or cannot be seconds, or a camera a second away from the others.
    """
    text = read_bytes(path, what="times of pictures, a line for each frame").decode("utf-8-sig", "replace")
    lines = [re.split(r"[,;\t ]+", line.strip()) for line in text.splitlines() if line.strip()]
    columns, remark = None, ""
    if lines and any(re.search(r"[A-Za-z]", each) and not _is_number(each) for each in lines[0]):
        columns, remark = _columns(path, lines.pop(0), cameras)
    with prefixed(path, "; expected times in seconds, a line for each frame"):
        values = [[float(each) if each else float("nan") for each in line] for line in lines]
    wanted = (max(columns) + 1,) if columns else (1, len(cameras))
    if len(values) != frames or any(len(line) < wanted[0] if columns else len(line) not in wanted for line in values):
        widths = sorted({len(line) for line in values})
        raise ValueError(
            f"{path}: expected {frames} lines, one for each frame, of {' or '.join(map(str, wanted))} numbers; got "
            f"{len(values)} lines of {', '.join(map(str, widths)) or 'no'} numbers"
        )
    chosen = [[line[k] for k in columns] if columns else line for line in values]
    times = np.array([line * (len(cameras) if len(line) == 1 else 1) for line in chosen]).reshape(frames, len(cameras))
    of_frames = np.array([np.nanmean(row) if np.isfinite(row).any() else np.nan for row in times])
    steps = np.diff(of_frames)
    if not np.isfinite(of_frames).all() or (steps <= 0).any():
        raise ValueError(f"{path}: the times of frames must be numbers of seconds that increase")
    if len(steps) and not _FASTEST <= np.median(steps) <= _SLOWEST:
        raise ValueError(
            f"{path}: {np.median(steps):.4g} from frame to frame, expected seconds ({_FASTEST:g} to {_SLOWEST:g}): "
            "divide milliseconds by 1000, or nanoseconds by 1000000000; state the rate of a time lapse by --fps"
        )
    ahead = [times[:, [camera]] - np.delete(times, camera, axis=1) for camera in range(len(cameras))]  # of all others
    offsets = [float(np.median(each[np.isfinite(each)])) if np.isfinite(each).any() else 0.0 for each in ahead]
    offset, camera = max(zip(offsets, cameras, strict=True), key=lambda each: abs(each[0]))
    if abs(offset) > _SLOWEST:
        raise ValueError(
            f"{path}: the times of camera {camera} are {abs(offset):.4g} s {'after' if offset > 0 else 'before'} those "
            f"of the others, expected at most {_SLOWEST:g} s in a frame: subtract {offset:.4g} from them"
        )
    return times, remark


def _columns(path: Path, names: Sequence[str], cameras: Sequence[str]) -> tuple[list[int], str]:
    """Return the columns of the times, one or V, and which they are."""
    plain = [canonical(name) for name in names]
    rows = [plain.index(canonical(camera)) if canonical(camera) in plain else -1 for camera in cameras]
    if min(rows) >= 0 and len(set(rows)) == len(rows):
        others = [name for row, name in enumerate(names) if row not in rows]
        left_out = f"; left out: {listed(others)}" if others else ""
        return rows, f"{path}: times of {listed([names[row] for row in rows])}, by the first line{left_out}"
    named = [row for row, name in enumerate(plain) if name in _TIMES]
    if len(named) == 1:
        return named, f"{path}: times of {names[named[0]]!r}, by the first line, for all cameras"
    raise ValueError(
        f"{path}: the first line has the names {listed(names)}; expected those of the cameras, {listed(cameras)}, or "
        "one column called time; or leave the line out, with one column or those of the cameras in order"
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
