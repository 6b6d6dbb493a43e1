"""Values of the options of ``simharness rehearse``: sizes, polygons, boxes and targets as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simharness.planning.rehearsal_result import Target
from simharness.planning.visibility import Obstacle
from simharness.planning.volume import Volume
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.room_section import ClutterSection

_ROOM_HEIGHT = 3.0  # metres, unless another is given


def volume_of(text: str) -> Volume:
    """Return a volume: "4x3", "4x3@1,0.5", or the corners of a polygon, "0,0 4,0 4,3".

    Raises:
        ValueError: none of these, or a polygon that is not closed simply: its sides cross, or it has no area.
    """
    if "x" in text:
        sides, _, middle = text.partition("@")
        width, depth = _numbers("--volume", sides, "x", (2,))
        center = _numbers("--volume", middle, ",", (2,)) if middle else (0.0, 0.0)
        if min(width, depth) <= 0:
            raise ValueError(f"--volume {text}: expected sides above 0 m, got {width:g} by {depth:g}")
        return Volume.box(width, depth, center=(center[0], center[1]))
    corners = np.array([_numbers("--volume", each, ",", (2,)) for each in text.split() if "," in text])
    if len(corners) < 3:
        raise ValueError(
            f"--volume {text}: expected a size, 4x3, or three corners or more, 0,0 4,0 4,3, got {len(corners)}: the "
            "volume is not closed; add corners"
        )
    if np.array_equal(corners[0], corners[-1]):
        corners = corners[:-1]
    if crossing := _crossing(corners):
        raise ValueError(
            f"--volume {text}: sides {crossing[0]} and {crossing[1]} cross, so the volume is not closed: give the "
            "corners in order around it"
        )
    try:
        return Volume(corners)
    except ValueError as error:
        raise ValueError(f"--volume {text}: {error}") from None


@dataclass(frozen=True)
class Surroundings:
    """What a room says of a rehearsal.

    Attributes:
        room: its floor and height.
        volume: where people are; None where the room does not say it.
        obstacles: boxes that hide people.
        people: their number; None where the room does not say it.
        detector: profile of the detector; None likewise.
    """

    room: Volume
    volume: Volume | None = None
    obstacles: tuple[Obstacle, ...] = ()
    people: int | None = None
    detector: DetectorSection | None = None


def surroundings_of(text: str) -> Surroundings:
    """Return what a room says: a size around the origin, "8x6x3", or a room file of ``simharness plan``.

    Raises:
        ValueError: neither a size nor a room file, or a mistake in the file.
    """
    if all(each.isnumeric() or each in ".x" for each in text):
        return Surroundings(room_of(text))
    from simharness.planning.room_file import read_room
    from simharness.planning.value_fit import obstacles_of

    room = read_room(text)
    return Surroundings(
        Volume(room.outline, room.height),
        Volume(room.volume, room.volume_height),
        obstacles_of(room),
        room.keys.people.count,
        room.detector,
    )


def room_of(text: str) -> Volume:
    """Return a room around the origin: "8x6", or "8x6x3" with its height.

    Raises:
        ValueError: not of this form, or sides that are not above 0 m.
    """
    sides = _numbers("--room", text, "x", (2, 3))
    if min(sides) <= 0:
        raise ValueError(f"--room {text}: expected sides above 0 m")
    return Volume.box(sides[0], sides[1], height=sides[2] if len(sides) > 2 else _ROOM_HEIGHT)


def obstacle_of(text: str) -> Obstacle:
    """Return a box on the floor: "x,y,width,depth,height".

    Raises:
        ValueError: not five numbers, or sizes that are not above 0 m.
    """
    x, y, width, depth, height = _numbers("--obstacle", text, ",", (5,))
    if min(width, depth, height) <= 0:
        raise ValueError(f"--obstacle {text}: expected width, depth and height above 0 m")
    return Obstacle(np.array([x, y, height / 2]), np.array([width, depth, height]))


def clutter_of(texts: Sequence[str]) -> ClutterSection:
    """Return the numbers of objects: "boxes=6", "shelves=1".

    Raises:
        ValueError: not of this form, or no such kind of objects.
    """
    kinds = [name for name in ClutterSection.model_fields if name != "coverage"]
    numbers = {}
    for text in texts:
        kind, _, number = text.partition("=")
        if kind not in kinds or not number.isdecimal():
            raise ValueError(f"--clutter {text}: expected a kind and a number, boxes=6; kinds are {', '.join(kinds)}")
        numbers[kind] = int(number)
    return ClutterSection(**numbers)


def target_of(text: str) -> Target:
    """Return a target: "95,40", PCP in percent and joint error in mm.

    Raises:
        ValueError: not two numbers, or a value that cannot be met.
    """
    pcp, error_mm = _numbers("--target", text, ",", (2,))
    try:
        return Target(pcp, error_mm)
    except ValueError as error:
        raise ValueError(f"--target {text}: {error}") from None


def picture_size(text: str) -> tuple[int, int]:
    """Return a size of pictures: "1920x1080".

    Raises:
        ValueError: not two whole numbers above 0.
    """
    width, height = _numbers("--size", text, "x", (2,))
    if not (width.is_integer() and height.is_integer() and min(width, height) > 0):
        raise ValueError(f"--size {text}: expected two whole numbers of pixels, 1920x1080")
    return int(width), int(height)


def _numbers(option: str, text: str, separator: str, counts: tuple[int, ...]) -> tuple[float, ...]:
    """Return the finite numbers of a text.

    Raises:
        ValueError: something that is no number, or another number of them.
    """
    try:
        values = tuple(float(each) for each in text.split(separator))
    except ValueError:
        values = ()
    if len(values) not in counts or not all(math.isfinite(each) for each in values):
        form = separator.join(["NUMBER"] * counts[0])
        raise ValueError(f"{option}: expected {' or '.join(map(str, counts))} numbers, {form}, got {text!r}")
    return values


def _crossing(corners: np.ndarray) -> tuple[int, int] | None:
    """Return two sides of a polygon (n, 2) that cross, counted from 1; None where none do."""
    ends = np.roll(corners, -1, axis=0)
    count = len(corners)
    for i in range(count):
        for j in range(i + 2, count):
            if i == 0 and j == count - 1:
                continue
            if _side(corners[i], ends[i], corners[j]) * _side(corners[i], ends[i], ends[j]) < 0 and (
                _side(corners[j], ends[j], corners[i]) * _side(corners[j], ends[j], ends[i]) < 0
            ):
                return i + 1, j + 1
    return None


def _side(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> float:
    along, to = end - start, point - start
    return float(along[0] * to[1] - along[1] * to[0])
