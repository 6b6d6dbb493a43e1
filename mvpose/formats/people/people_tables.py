"""Long tables of people, CSV and Parquet: one row for each joint of a person in a frame.

Metres, z up. ``frame`` counts from 0, ``time`` is in seconds, ``person`` is the identity, ``joint`` the name of the
joint. ``cov_xx`` to ``cov_zz`` are the six different elements of the covariance of the joint's error, square metres;
empty where unknown. A joint that was not estimated has no row.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from mvpose.formats.people.people_files import Export

_COVARIANCE = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}


def write_csv(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the table as text, with positions in micrometres and scores in 1e-6."""
    import polars as pl

    content = io.BytesIO()
    table(export).with_columns(pl.col("time", "x", "y", "z", "score").round(6)).write_csv(content)
    yield "poses.csv", content.getvalue()


def write_parquet(export: Export) -> Iterator[tuple[str, bytes]]:
    """Yield the table as Parquet."""
    content = io.BytesIO()
    table(export).write_parquet(content)
    yield "poses.parquet", content.getvalue()


def table(export: Export) -> Any:
    """Return a ``polars.DataFrame``: frame, time, person, joint, x, y, z, score and six columns of covariance."""
    import polars as pl

    people, axes = export.people, export.axes("z")
    frame, column, joint = np.nonzero(people.present)
    x, y, z = axes @ people.joints[frame, column, joint].T
    columns = {
        "frame": frame,
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
    yield "bone_lengths.csv", ("\n".join(["person,bone,metres", *lines]) + "\n").encode()
