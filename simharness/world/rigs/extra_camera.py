"""One more camera for a rig, with the lens and the picture of the first: on the walls around people, or in the widest
gap between the bearings of the others.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from simharness.world.rigs.layouts import look_at

_AIM = 1.0  # metres: height at which cameras on walls look
_FROM_WALL = 0.15  # metres
_HIGH = 2.5  # metres: a camera that nobody walks into
_BELOW_CEILING = 0.2  # metres
_BEYOND = 0.5  # metres from the people, where the room is unknown
_TAKEN = 0.4  # metres: no second camera at the place of another
_PARALLEL = 1e-3  # weight of a point ahead of the cameras, which counts where all look the same way


def cameras_on_walls(
    rig: Rig, area: Floats, *, walls: Floats | None = None, ceiling: float = np.inf, around: int = 16
) -> list[Camera]:
    """Return cameras that could be added on the walls of a room, aimed at the middle of an area.

    They are at the median height of the rig and at 2.5 m, below the ceiling.

    Args:
        rig: the cameras that are there.
        area: corners of the floor on which people are, (n, 2), metres.
        walls: corners of the room, (n, 2), metres; None: those of the rectangle around the cameras and the area.
        ceiling: height of the room, metres.
        around: number of places on its walls, evenly spaced from a corner on.
    """
    middle = area.mean(axis=0)
    highest = ceiling - _BELOW_CEILING
    heights = sorted({round(min(height, highest), 2) for height in (float(np.median(rig.centers[:, 2])), _HIGH)})
    places = _around(_rectangle(rig, area) if walls is None else walls, middle, around)
    centers = (np.array([*place, height]) for place in places for height in heights)
    free = (each for each in centers if np.linalg.norm(rig.centers - each, axis=1).min() >= _TAKEN)
    return [_camera_like(rig[0], each, (*middle, _AIM), name="one more") for each in free]


def with_camera_in_gap(rig: Rig, is_free: Callable[[Floats], bool], *, reach: ArrayLike | None = None) -> Rig:
    """Return the rig with one more camera behind the others, which stay as they are.

    It stands in the middle of the widest gap between the bearings of the cameras, as far away and as high as they are
    (medians), and looks at the point at which they look. If that place is not free, the next widest gap is taken; if no
    gap is free, the widest.

    Args:
        rig: the V cameras.
        is_free: whether a camera can stand at a place, (3,), metres.
        reach: largest absolute x and y, and largest z, of a place, metres; None: unlimited.
    """
    aim = _aim(rig)
    away = rig.centers - aim
    bearings = np.sort(np.arctan2(away[:, 1], away[:, 0]))
    gaps = np.diff(bearings, append=bearings[0] + 2 * np.pi)
    distance, height = np.median(np.linalg.norm(away[:, :2], axis=1)), np.median(rig.centers[:, 2])
    places = []
    for gap in np.argsort(-gaps, kind="stable").tolist():
        bearing = bearings[gap] + gaps[gap] / 2
        place = np.array([aim[0] + distance * np.cos(bearing), aim[1] + distance * np.sin(bearing), height])
        if reach is not None:
            limit = np.asarray(reach, float)
            place = np.clip(place, [*-limit[:2], 0.0], limit)
        places.append(place)
    place = next(filter(is_free, places), places[0])
    taken = {camera.name for camera in rig}
    name = next(name for k in range(len(rig), 2 * len(rig) + 2) if (name := f"cam{k}") not in taken)
    return Rig([*rig, _camera_like(rig[0], place, aim, name=name)])


def _camera_like(first: Camera, place: Floats, aim: ArrayLike, *, name: str) -> Camera:
    """Return a camera with the lens, the picture and the shutter of another."""
    made = look_at(place, aim, K=first.K, size=first.size, distortion=first.distortion, name=name)
    return replace(made, readout=first.readout)


def _aim(rig: Rig) -> Floats:
    """Return the point nearest to all optical axes, (3,), metres."""
    axes = np.stack([camera.R[2] for camera in rig])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]  # projection to the plane perpendicular to an axis
    ahead = (rig.centers + 4.0 * axes).mean(axis=0)
    normal = across.sum(axis=0) + _PARALLEL * np.eye(3)
    return np.linalg.solve(normal, (across @ rig.centers[:, :, None]).sum(axis=0)[:, 0] + _PARALLEL * ahead)


def _rectangle(rig: Rig, area: Floats) -> Floats:
    """Return the corners of the rectangle around the cameras and the area, (4, 2), metres."""
    points = np.concatenate([rig.centers[:, :2], area - _BEYOND, area + _BEYOND])
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _around(outline: Floats, middle: Floats, count: int) -> Floats:
    """Return evenly spaced places on a polygon, corners first, drawn in from the walls towards the middle, (n, 2)."""
    closed = np.concatenate([outline, outline[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    along = np.linspace(0.0, arc[-1], count, endpoint=False)
    places = np.stack([np.interp(along, arc, closed[:, axis]) for axis in (0, 1)], axis=-1)
    inward = middle - places
    return places + _FROM_WALL * inward / np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-9)
