"""Reader of tracked people: the table ``poses.parquet`` of ``mvpose estimate`` and ``mvpose run``."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from mvpose.files.input_files import TABLE, read_bytes, read_json_object
from mvpose.files.message_text import listed, one_line
from mvpose.recording import PERIOD, People
from mvpose.skeleton import COCO17, Skeleton

TABLE_NAME = "poses.parquet"
"""Name of the table in a folder of results."""

_INPUTS = "inputs.json"
_COLUMNS = ("frame", "time", "person", "joint", "x", "y", "z", "score")
_MOST_FRAMES = 2_000_000  # as of recordings that are read


def read_people(path: str | Path, *, skeleton: Skeleton = COCO17) -> People:
    """Read tracked people.

    Args:
        path: a folder of results, or the table in it (:mod:`mvpose.formats.people.people_tables`).
        skeleton: joints to read; other joints of the table are left out, and joints that it lacks are missing.

    Returns:
        The people, without covariances. Frames are those of the recording where ``inputs.json`` beside the table says
        how many there are, also after the last one with people; otherwise they end there.

    Raises:
        ValueError: no table, a table of other columns, without any joint of the skeleton, or with a row for a joint
            that another row has already given.
    """
    import polars as pl

    file = _table_of(Path(path))
    content = read_bytes(file, what="people, as `mvpose estimate` writes them", most=TABLE)
    try:
        table = pl.read_parquet(io.BytesIO(content))
        missing = [name for name in _COLUMNS if name not in table.columns]
        if missing:
            raise ValueError(
                f"has no column {listed(missing)}; expected those of `mvpose estimate`: {listed(_COLUMNS)}"
            )
        numbers = {name: table[name].cast(pl.Float64).to_numpy() for name in _COLUMNS if name != "joint"}
        names = table["joint"].cast(pl.String).to_list()
    except (pl.exceptions.PolarsError, OSError, ValueError) as error:
        raise ValueError(one_line(f"{file}: {error}")) from None
    columns = {name: column for column, name in enumerate(skeleton.joints)}
    joint = np.array([columns.get(name, -1) for name in names], np.int64)
    if len(joint) and (joint < 0).all():
        raise ValueError(f"{file}: has no joint of the skeleton {skeleton.name}, but {listed(sorted(set(names))[:5])}")
    kept = joint >= 0
    frame, person, joint = numbers["frame"][kept], numbers["person"][kept], joint[kept]
    for name, values in (("frame", frame), ("person", person)):
        if not (np.isfinite(values).all() and (values == np.round(values)).all()):
            raise ValueError(f"{file}: column {name} must hold whole numbers")
    rows = frame.astype(np.int64)
    if len(rows) and not 0 <= rows.min() <= rows.max() < _MOST_FRAMES:
        raise ValueError(f"{file}: frames must count from 0, got {rows.min()} to {rows.max()}")
    ids, who = np.unique(person.astype(np.int64), return_inverse=True)
    count = _frame_count(file, int(rows.max(initial=-1)) + 1)
    flat = np.ravel_multi_index((rows, who, joint), (count, max(1, len(ids)), len(skeleton)))
    if len(np.unique(flat)) < len(flat):
        raise ValueError(f"{file}: has two rows for one joint of a person in a frame; expected one")
    joints, scores = np.full((count, len(ids), len(skeleton), 3), np.nan), np.zeros((count, len(ids), len(skeleton)))
    joints[rows, who, joint] = np.stack([numbers[axis][kept] for axis in "xyz"], axis=1)
    scores[rows, who, joint] = numbers["score"][kept]
    try:
        return People(_times(rows, numbers["time"][kept], count), ids, joints, scores, skeleton=skeleton)
    except ValueError as error:
        raise ValueError(one_line(f"{file}: {error}")) from None


def _table_of(path: Path) -> Path:
    """Return the table of a folder of results; other paths stay."""
    if not path.is_dir():
        return path
    if not (path / TABLE_NAME).is_file():
        raise ValueError(f"{path}: has no {TABLE_NAME}; expected a folder that `mvpose estimate ... --out` made")
    return path / TABLE_NAME


def _frame_count(file: Path, least: int) -> int:
    """Return the number of frames by the file beside a table, or at least the given one."""
    about = file.with_name(_INPUTS)
    if not about.is_file():
        return least
    numbers = read_json_object(about, what="the inputs of `mvpose estimate`").get("numbers")
    if not isinstance(numbers, list) or len(numbers) < least:
        raise ValueError(f"{about}: expected the numbers of at least {least} frames; it is not of this table")
    return len(numbers)


def _times(rows: np.ndarray, time: np.ndarray, count: int) -> np.ndarray:
    """Return the time of each frame, (T,), seconds; frames without people lie evenly between or beside the others."""
    known, first = np.unique(rows, return_index=True)
    frames = np.arange(count, dtype=np.float64)
    if not len(known):
        return frames * PERIOD
    given = time[first]
    step = float(np.median(np.diff(given) / np.diff(known))) if len(known) > 1 else PERIOD
    times = np.interp(frames, known, given)
    times[: known[0]] = given[0] + (frames[: known[0]] - known[0]) * step
    times[known[-1] + 1 :] = given[-1] + (frames[known[-1] + 1 :] - known[-1]) * step
    return times
