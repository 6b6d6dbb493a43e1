"""Tables of numbers for pages: cells with text and a shade."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats, Integers
from mvpose.recording import People
from mvpose.report.measures import Bone
from mvpose.report.palette import identity_color
from mvpose.skeleton import COCO17, Skeleton

NOTHING = "–"
"""Text of a number that does not exist."""

_MOST_GROUPS = 16  # rows of a table of joints; of larger skeletons only the groups of COCO17 have rows of their own


@dataclass(frozen=True)
class Cell:
    """Cell of a table."""

    text: str
    """The number."""
    small: str = ""
    """Second line; of a head, the word before the text, which narrow tables leave out."""
    share: float = 0.0
    """Shade, 0 (none) to 1 (full)."""
    color: str = ""
    """Chip before the text; empty for none."""
    strong: bool = False
    """Whether the number is bold."""


@dataclass(frozen=True)
class Table:
    """Table of a page: the heads of its columns, and rows of a name and cells; the last row is a total if ``total``."""

    heads: tuple[Cell, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]
    total: bool = False


def number(value: float, digits: int = 1) -> str:
    """Return a number with its decimals, or :data:`NOTHING` where it is not finite."""
    return f"{value:.{digits}f}" if math.isfinite(value) else NOTHING


def joint_groups(skeleton: Skeleton) -> tuple[tuple[str, ...], Integers]:
    """Return names of groups of joints, and the group of each joint, (J,).

    Both sides of a joint are a group, and so are numbered points (``face_0`` to ``face_67``). Of skeletons with still
    more groups, all joints that COCO17 does not have are one.
    """
    names = [re.sub(r"_\d+$", "", part) for part in skeleton.parts]
    parts = list(dict.fromkeys(names))
    if len(parts) > _MOST_GROUPS:
        parts = [part for part in dict.fromkeys(COCO17.parts) if part in parts] + ["other joints"]
    index = np.array([parts.index(part) if part in parts else len(parts) - 1 for part in names])
    return tuple(part.replace("_", " ") for part in parts), index


def residual_table(
    names: Sequence[str], cells: Floats, *, rows: Sequence[str], by_row: Floats, by_column: Floats, overall: float
) -> Table:
    """Return residuals as a table with shades: joints as rows, cameras as columns, and totals.

    Args:
        names: of the V cameras.
        cells: (G, V), pixels.
        rows: names of the G groups of joints.
        by_row: of each group over all cameras, (G,).
        by_column: of each camera over all joints, (V,).
        overall: of all.
    """
    most = _full(cells)
    body = [
        (name, (*(_shaded(value, most) for value in row), Cell(number(total))))
        for name, row, total in zip(rows, cells.tolist(), by_row.tolist(), strict=True)
    ]
    last = tuple(Cell(number(value)) for value in (*by_column.tolist(), overall))
    return Table((*(Cell(name) for name in names), Cell("all")), (*body, ("all", last)), total=True)


def _full(values: Floats) -> float:
    """Return the value of the full shade: the largest, or twice the median, so that one ghost does not bleach all."""
    known = values[np.isfinite(values)]
    return float(min(known.max(), 2.0 * np.median(known))) if len(known) else 1.0


def _shaded(value: float, most: float, digits: int = 1) -> Cell:
    return Cell(number(value, digits), share=min(value / most, 1.0) if math.isfinite(value) and most > 0 else 0.0)


def error_table(errors: Floats, by_group: Floats, groups: Sequence[str], people: People, rows: Sequence[int]) -> Table:
    """Return expected errors as a table: groups of joints as rows, people as columns.

    Args:
        errors: of each person over all joints, (n,), metres.
        by_group: (n, G), metres.
        groups: names of the G groups.
        people: n people.
        rows: the people to show.
    """
    shown = 1000 * by_group[list(rows)]
    most = _full(shown)
    body = [
        (name, tuple(_shaded(value, most, 0) for value in column))
        for name, column in zip(groups, shown.T.tolist(), strict=True)
    ]
    last = tuple(Cell(number(1000 * errors[row], 0)) for row in rows)
    return Table(_heads(people, rows), (*body, ("all joints", last)), total=True)


def bone_table(bones: Sequence[Bone], people: People, rows: Sequence[int]) -> Table:
    """Return lengths of bones as a table, centimetres: bones as rows, people as columns."""
    found = {(bone.name, bone.person): bone for bone in bones}
    names = list(dict.fromkeys(name for name, _ in found))
    body = []
    for name in names:
        cells = []
        for row in rows:
            bone = found.get((name, row))
            if bone is None:
                cells.append(Cell(NOTHING))
                continue
            sides = f"\n{100 * bone.asymmetry:.1f} %" if math.isfinite(bone.asymmetry) else ""
            share = min(1.0, bone.spread / bone.length / 0.1)
            cells.append(Cell(f"{100 * bone.length:.1f}", f"± {100 * bone.spread:.1f}{sides}", share))
        body.append((name, tuple(cells)))
    return Table(_heads(people, rows), tuple(body))


def _heads(people: People, rows: Sequence[int]) -> tuple[Cell, ...]:
    return tuple(Cell(str(people.ids[row]), small="person", color=identity_color(row)) for row in rows)
