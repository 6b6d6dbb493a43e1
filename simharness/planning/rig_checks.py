"""Checks of a rig in its room before a rehearsal: cameras inside walls or objects, and volumes outside of the room."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mvpose import Camera, Rig
from simharness.planning.visibility import Obstacle
from simharness.planning.volume import Volume

_WALL = 0.005  # metres that a camera on a wall may be within it, because files are rounded


def check_rig(rig: Rig, volume: Volume, *, room: Volume | None = None, obstacles: Sequence[Obstacle] = ()) -> None:
    """Check that cameras hang in the room and people can be in the volume.

    Args:
        rig: the cameras.
        volume: where people are.
        room: floor and height of the room; None where it is unknown.
        obstacles: boxes in the room.

    Raises:
        ValueError: a camera under the floor, outside of the room, above its ceiling or inside an obstacle, or a volume
            that is not inside the room. The message names the camera, where it is, and what to change.
    """
    for camera in rig:
        where = _where(camera)
        if camera.center[2] <= 0.0:
            raise ValueError(
                f"{where} is not above the floor, which is at z = 0: move it, or move the calibration's origin to the "
                "floor, with z up"
            )
        if room is not None:
            _check_in_room(camera, room, where)
        for number, obstacle in enumerate(obstacles):
            if _inside(camera, obstacle):
                x, y, z = obstacle.center
                raise ValueError(
                    f"{where} is inside obstacle {number}, whose middle is at ({x:.2f}, {y:.2f}, {z:.2f}) m: move one "
                    "of them"
                )
    if room is not None:
        beyond = volume.outline[~_contains(room, volume.outline)]
        if len(beyond):
            x, y = beyond[0]
            raise ValueError(
                f"--volume: its corner ({x:.2f}, {y:.2f}) m is outside of the room {_span(room)}: make the volume "
                "smaller, or correct the room"
            )


def _check_in_room(camera: Camera, room: Volume, where: str) -> None:
    if not _contains(room, camera.center[None, :2])[0]:
        distance = _distance(room, camera)
        raise ValueError(
            f"{where} is {distance:.2f} m outside of the room {_span(room)}, in or behind a wall: move the camera, or "
            "correct the room"
        )
    if camera.center[2] > room.height + _WALL:
        raise ValueError(
            f"{where} is above the ceiling, which is {room.height:g} m high: move the camera, or correct the room"
        )


def _where(camera: Camera) -> str:
    x, y, z = camera.center
    return f"camera {camera.name!r} at ({x:.2f}, {y:.2f}, {z:.2f}) m"


def _span(room: Volume) -> str:
    low, high = room.outline.min(axis=0), room.outline.max(axis=0)
    return f"({low[0]:g} to {high[0]:g} m along x, {low[1]:g} to {high[1]:g} m along y)"


def _contains(room: Volume, places: np.ndarray) -> np.ndarray:
    """Return which places (n, 2) are in the room or on its walls."""
    return np.array([bool(room.contains(place)) or _edge_distance(room, place) <= _WALL for place in places])


def _distance(room: Volume, camera: Camera) -> float:
    return _edge_distance(room, camera.center[:2])


def _edge_distance(room: Volume, place: np.ndarray) -> float:
    """Return the distance of a place (2,) from the nearest wall, metres."""
    start = room.outline
    along = np.roll(start, -1, axis=0) - start
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((place - start) * along).sum(axis=1) / length, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * along - place, axis=1).min())


def _inside(camera: Camera, obstacle: Obstacle) -> bool:
    cos, sin = np.cos(obstacle.yaw), np.sin(obstacle.yaw)
    local = (camera.center - obstacle.center) @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1.0]])
    return bool((np.abs(local) < obstacle.size / 2).all())
