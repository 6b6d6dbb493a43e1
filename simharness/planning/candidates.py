"""Candidates: cameras that may hang in a room, by place, direction and lens, and their small changes."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose import Camera
from mvpose.arrays import Floats
from simharness.planning.planned_room import Room

_AIM_HEIGHT = 0.95  # metres: the height of the hips, about which people are centred
_AIM_SPACING = 1.5  # metres between the points of the volume at which candidates look
_SAME_DIRECTION = 15.0  # degrees: candidates of one place and lens look at least so far apart
_SAME_PLACE, _SAME_TURN = 1.0, 30.0  # metres and degrees within which two cameras are alike
_STEEPEST = np.radians(80.0)  # of a direction below or above the horizon: upright cameras have a bearing


@dataclass(frozen=True)
class Candidate:
    """Camera that may hang in a room."""

    mount: int
    """Index of its mount."""
    lens: int
    """Index of its lens."""
    place: tuple[float, float, float]
    """Position, three coordinates in metres."""
    bearing: float
    """Direction of view from the x axis, counter-clockwise from above, radians."""
    tilt: float
    """Direction of view above the horizon, radians; negative below."""

    @property
    def direction(self) -> Floats:
        """Unit vector of the direction of view, (3,)."""
        flat = np.cos(self.tilt)
        return np.array([flat * np.cos(self.bearing), flat * np.sin(self.bearing), np.sin(self.tilt)])

    def camera(self, room: Room, *, name: str = "") -> Camera:
        """Return the camera."""
        place = np.array(self.place)
        return room.lenses[self.lens].camera(place, place + self.direction, name=name)


def candidate(mount: int, lens: int, place: ArrayLike, aim: ArrayLike) -> Candidate:
    """Return the candidate at a place (3,) that looks at a point (3,)."""
    place = np.asarray(place, float)
    way = np.asarray(aim, float) - place
    x, y, z = place.tolist()
    tilt = float(np.clip(np.arctan2(way[2], np.hypot(way[0], way[1])), -_STEEPEST, _STEEPEST))
    return Candidate(mount, lens, (x, y, z), float(np.arctan2(way[1], way[0])), tilt)


def aims_in(room: Room) -> Floats:
    """Return points of the volume at which candidates look, (n, 3), metres: its middle first, then a grid."""
    low, high = room.volume.bounds
    counts = np.maximum(np.round((high - low) / _AIM_SPACING).astype(int), 1) + 1
    x, y = (np.linspace(a, b, n + 2)[1:-1] for a, b, n in zip(low, high, counts, strict=True))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[room.volume.contains(grid)]
    middle = grid.mean(axis=0) if len(grid) else room.volume.outline.mean(axis=0)
    return np.column_stack([np.vstack([middle, grid]), np.full(1 + len(grid), _AIM_HEIGHT)])


def places_in(room: Room, *, spacing: float, levels: float) -> list[tuple[int, Floats]]:
    """Return the places where cameras may hang, each with the index of its mount.

    Args:
        room: the room.
        spacing: largest distance between neighbours on a mount, metres.
        levels: largest distance in height, metres.

    Raises:
        ValueError: no place to hang; the message names the keys to change.
    """
    found = []
    for index, mount in enumerate(room.mounts):
        grid = mount.grid(spacing, levels=levels)
        found += [(index, place) for place in grid[room.may_hang(mount, grid)]]
    if not found:
        kinds = ", ".join(dict.fromkeys(mount.kind for mount in room.mounts)) or "none"
        raise ValueError(
            f"{room.file or room.name}: there is no place to hang a camera: every place of [places] ({kinds}) is "
            "inside a wall or an obstacle, at a door, or in reach of people; change places, cameras.from_people, "
            "cameras.from_walls, or the volume"
        )
    return found


def candidates_in(room: Room, *, spacing: float = 0.75, most: int | None = None) -> list[Candidate]:
    """Return cameras that may hang in a room, on a grid of places, looking at points of the volume.

    Args:
        room: the room.
        spacing: largest distance between neighbouring places on a mount, metres.
        most: largest number of candidates: the spacing is enlarged until they are no more.

    Raises:
        ValueError: no place to hang.
    """
    aims, levels = aims_in(room), 0.75
    while True:
        places = places_in(room, spacing=spacing, levels=levels)
        found = [
            each
            for mount, place in places
            for lens in range(len(room.lenses))
            for each in _looks(mount, lens, place, aims)
        ]
        if most is None or len(found) <= most or spacing > 5.0:
            return found
        spacing, levels = 1.2 * spacing, 1.2 * levels


def _looks(mount: int, lens: int, place: Floats, aims: Floats) -> Iterator[Candidate]:
    """Yield the candidates of a place, the one that looks at the middle of the volume first."""
    kept: list[Floats] = []
    for aim in aims:
        each = candidate(mount, lens, place, aim)
        if all(each.direction @ other < np.cos(np.radians(_SAME_DIRECTION)) for other in kept):
            kept.append(each.direction)
            yield each


def moved(room: Room, start: Candidate, step: ArrayLike) -> Candidate | None:
    """Return a candidate moved on its mount and turned; None where no camera may be.

    Args:
        room: the room.
        start: the candidate.
        step: movement along the edges of the mount, metres, then changes of bearing and tilt, radians, (5,).
    """
    step = np.asarray(step, float)
    mount = room.mounts[start.mount]
    lengths = mount.lengths
    shares = mount.nearest(start.place) + np.where(lengths > 0, step[:3] / np.where(lengths > 0, lengths, 1.0), 0.0)
    place = mount.at(shares)
    if not room.may_hang(mount, place):
        return None
    x, y, z = place.tolist()
    tilt = float(np.clip(start.tilt + step[4], -_STEEPEST, _STEEPEST))
    return Candidate(start.mount, start.lens, (x, y, z), float(start.bearing + step[3]), tilt)


def far_enough(room: Room, candidates: Sequence[Candidate], fixed: Sequence[Camera] = ()) -> bool:
    """Return whether cameras keep the smallest distance between two cameras; those that hang already count too."""
    centers = np.array([each.place for each in candidates] + [camera.center for camera in fixed]).reshape(-1, 3)
    gaps = np.linalg.norm(centers[:, None] - centers[None], axis=-1)
    return bool((gaps[np.triu_indices(len(centers), 1)] >= room.keys.cameras.spacing - 1e-9).all())


def around(room: Room, candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """Return candidates in the order of their bearings from the middle of the volume, counter-clockwise."""
    x, y = room.volume.outline.mean(axis=0).tolist()
    return tuple(sorted(candidates, key=lambda each: math.atan2(each.place[1] - y, each.place[0] - x) % (2 * math.pi)))


def alike(one: Candidate, other: Candidate) -> bool:
    """Return whether two cameras hang at about the same place and look the same way."""
    away = float(np.linalg.norm(np.subtract(one.place, other.place)))
    return away <= _SAME_PLACE and float(one.direction @ other.direction) >= np.cos(np.radians(_SAME_TURN))
