"""Long tables of people, CSV and Parquet: one row for each joint of a person in a frame; and tables of bone lengths.

Metres, z up. ``frame`` is the number of the frame, ``time`` is in seconds, ``person`` is the identity, ``joint`` the
name of the joint. ``cov_xx`` to ``cov_zz`` are the six different elements of the covariance of the joint's error, in
square metres; empty where unknown. A joint that was not estimated has no row.
"""

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.files.input_files import TABLE, read_bytes, read_json_object
from mvpose.files.message_text import listed, one_line, prefixed
from mvpose.formats.joint_names import JointNames, skeleton_of
from mvpose.formats.people.people_files import Export, PeopleFiles
from mvpose.recording import PERIOD, People
from mvpose.skeleton import COCO17, PANOPTIC19, SHELF14, Skeleton
from mvpose.wholebody import known_names, skeleton_by_name

INPUTS = "inputs.json"
"""Name of the file beside the table, in a folder of ``mvpose estimate``, that says how many frames there are."""

_COLUMNS = ("frame", "time", "person", "joint", "x", "y", "z", "score")
_ROWS = 250_000  # of a group in a Parquet file
_MOST_FRAMES = 2_000_000  # as of recordings that are read
_COVARIANCE = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}


def write_csv(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the table as text, with positions in micrometres and scores in 1e-6."""
    import polars as pl

    content = io.BytesIO()
    table(export).with_columns(pl.col("time", "x", "y", "z", "score").round(6)).write_csv(
        content, include_header=export.first
    )
    yield "poses.csv", content.getvalue()


def write_parquet(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the table as Parquet."""
    content = io.BytesIO()
    table(export).write_parquet(content)
    yield "poses.parquet", content.getvalue()


def join_parquet(parts: Sequence[Path], path: Path) -> None:
    """Write the rows of several Parquet files as one, without holding them all in memory, and remove these files."""
    import polars as pl

    pl.scan_parquet(list(parts)).sink_parquet(path, row_group_size=_ROWS)
    for part in parts:
        part.unlink()


def table(export: Export) -> Any:
    """Return a ``polars.DataFrame``: frame, time, person, joint, x, y, z, score and six columns of covariance."""
    import polars as pl

    people, axes = export.people, export.axes("z")
    frame, column, joint = np.nonzero(people.present)
    x, y, z = axes @ people.joints[frame, column, joint].T
    columns = {
        "frame": people.numbers[frame],
        "time": people.times[frame],
        "person": people.ids[column],
        "joint": np.array(people.skeleton.joints)[joint],
        "x": x,
        "y": y,
        "z": z,
        "score": people.scores[frame, column, joint],
    }
    if people.covariance is not None:
        turned = axes @ people.covariance[frame, column, joint] @ axes.T
        columns |= {f"cov_{name}": turned[:, row, other] for name, (row, other) in _COVARIANCE.items()}
    result = pl.DataFrame(columns, schema_overrides={"joint": pl.String})
    if people.covariance is None:
        result = result.with_columns(pl.lit(None, pl.Float64).alias(f"cov_{name}") for name in _COVARIANCE)
    return result


def write_lengths(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the bone lengths of each person, from its fitted body: person, bone, metres.

    Both sides of the body have the same lengths; ``hip`` and ``shoulder`` are half the distance between both sides.
    """
    lines = [f"{fit.identity},{bone},{metres:.4f}" for fit in export.bodies for bone, metres in fit.lengths.items()]
    head = ["person,bone,metres"] if export.first else []
    yield "bone_lengths.csv", "".join(f"{line}\n" for line in (*head, *lines)).encode()


def read(files: PeopleFiles) -> People:
    """Read a table, Parquet or CSV (by the name of the file), with covariances where all joints have one.

    Frames are those of the recording where ``inputs.json`` beside the table says how many there are, also after the
    last one with people; otherwise they end there. They count from 0.

    Raises:
        ValueError: no table, a table of other columns, or with a row for a joint that another row has already given.
    """
    import polars as pl

    file = files.single()
    content = io.BytesIO(read_bytes(file, what="people, as `mvpose estimate` writes them", most=TABLE))
    covariances = [f"cov_{name}" for name in _COVARIANCE]
    try:
        table = pl.read_csv(content) if file.suffix.lower() == ".csv" else pl.read_parquet(content)
        missing = [name for name in _COLUMNS if name not in table.columns]
        if missing:
            raise ValueError(
                f"has no column {listed(missing)}; expected those of `mvpose estimate`: {listed(_COLUMNS)}"
            )
        read = [name for name in (*_COLUMNS, *covariances) if name != "joint" and name in table.columns]
        values = {name: table[name].cast(pl.Float64).to_numpy() for name in read}
        names = table["joint"].cast(pl.String).to_list()
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError, ValueError) as error:  # panics on damage
        raise ValueError(one_line(f"{file}: {error}")) from None
    skeleton = _skeleton(file, names)
    columns = {name: column for column, name in enumerate(skeleton.joints)}
    joint = np.array([columns[name] for name in names], np.int64)
    for name in ("frame", "person"):
        if not ((np.abs(values[name]) < 2.0**53) & (values[name] == np.round(values[name]))).all():
            raise ValueError(f"{file}: column {name} must hold whole numbers")
    rows = values["frame"].astype(np.int64)
    if len(rows) and not 0 <= rows.min() <= rows.max() < _MOST_FRAMES:
        raise ValueError(f"{file}: frames must count from 0, got {rows.min()} to {rows.max()}")
    ids, who = np.unique(values["person"].astype(np.int64), return_inverse=True)
    shape = _frame_count(file, int(rows.max(initial=-1)) + 1), len(ids), len(skeleton)
    flat = np.ravel_multi_index((rows, who, joint), (shape[0], max(1, shape[1]), shape[2]))
    if len(np.unique(flat)) < len(flat):
        raise ValueError(f"{file}: has two rows for one joint of a person in a frame; expected one")
    joints, scores, covariance = np.full((*shape, 3), np.nan), np.zeros(shape), None
    places = np.stack([values[axis] for axis in "xyz"], axis=1)
    joints[rows, who, joint] = np.where(np.isfinite(places), places, np.nan) @ files.axes("z").T
    scores[rows, who, joint] = values["score"]
    if len(rows) and all(name in values and np.isfinite(values[name]).all() for name in covariances):
        covariance = np.full((*shape, 3, 3), np.nan)
        for name, (row, other) in _COVARIANCE.items():
            covariance[rows, who, joint, row, other] = covariance[rows, who, joint, other, row] = values[f"cov_{name}"]
        covariance = files.axes("z") @ covariance @ files.axes("z").T
    with prefixed(file):
        return People(_times(rows, values["time"], shape[0]), ids, joints, scores, covariance, skeleton)


def _skeleton(file: Path, names: Sequence[str | None]) -> Skeleton:
    """Return the skeleton of a table, which has rows for the joints that were estimated only."""
    found = list(dict.fromkeys(names))
    if None in found:
        raise ValueError(f"{file}: column joint must hold the names of joints, got an empty one")
    for known in (COCO17, SHELF14, PANOPTIC19, *map(skeleton_by_name, known_names())):
        if set(found) <= set(known.joints):
            return known
    return skeleton_of(JointNames(file.name, tuple(map(str, found))))


def _frame_count(file: Path, least: int) -> int:
    """Return the number of frames by the file beside a table, or at least the given one."""
    about = file.with_name(INPUTS)
    if not about.is_file():
        return least
    numbers = read_json_object(about, what="the inputs of `mvpose estimate`").get("numbers")
    if not isinstance(numbers, list) or len(numbers) < least:
        raise ValueError(f"{about}: expected the numbers of at least {least} frames; it is not of this table")
    return len(numbers)


def _times(rows: Integers, time: Floats, count: int) -> Floats:
    """Return the time of each frame, (T,), seconds; frames without people lie evenly between or beside the others."""
    known, first = np.unique(rows, return_index=True)
    frames = np.arange(count, dtype=np.float64)
    if not len(known):
        return frames * PERIOD
    given = time[first]
    step = float(np.median(np.diff(given) / np.diff(known))) if len(known) > 1 else PERIOD
    times: Floats = np.interp(frames, known, given)
    times[: known[0]] = given[0] + (frames[: known[0]] - known[0]) * step
    times[known[-1] + 1 :] = given[-1] + (frames[known[-1] + 1 :] - known[-1]) * step
    return times
