"""Clearance of cameras from floor, walls and objects."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from simharness.scenario.sections.scenario import Scenario
from simharness.world.scene.objects.solids import Solid

WALL_MARGIN = 0.1
"""Least distance between a camera and a wall, metres."""
_ROUNDING = 1e-6  # metres: tolerance at limits, because processors round differently


def check_rig(scenario: Scenario, solids: Sequence[Solid], rig: Rig) -> None:
    """Check that every camera has clearance.

    Args:
        scenario: scenario with the room.
        solids: solids in the scene.
        rig: true cameras.

    Raises:
        ValueError: a camera under the floor or inside an object, or, if there are walls, behind a wall, less than 0.1 m
            from one, or above them. The message names the camera, its position, the obstacle, and the keys to change.
    """
    for camera in rig:
        place = camera.center
        where = f"camera {camera.name!r} at ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}) m"
        if place[2] <= 0.0:
            raise ValueError(f"{where} is not above the floor: use cameras.height above 0")
        if scenario.room.walls:
            _check_walls(scenario, rig, place, where)
        for solid in solids:
            if solid.kind != "room" and solid.trajectory is None and solid.hull.distance(place) == 0.0:
                raise ValueError(
                    f"{where} is inside {solid.name}, which stands at ({solid.hull.center[0]:.2f}, "
                    f"{solid.hull.center[1]:.2f}) and is {solid.hull.corners[:, 2].max():.2f} m high: change "
                    "cameras.height, cameras.radius or cameras.start, or the clutter"
                )


def _check_walls(scenario: Scenario, rig: Rig, place: NDArray[np.float64], where: str) -> None:
    x, y, z = scenario.room.size
    if place[2] > z + _ROUNDING:
        raise ValueError(
            f"{where} is above the walls, which are {z:g} m high: use cameras.height of at most {z:g}, a higher "
            "room.size, or room.walls = false"
        )
    limits = np.array([x / 2, y / 2]) - WALL_MARGIN
    beyond = np.abs(place[:2]) - limits
    if (beyond > _ROUNDING).any():
        axis = int(beyond.argmax())
        name = f"wall {'+' if place[axis] > 0 else '-'}{'xy'[axis]}"
        far = abs(place[axis]) - scenario.room.size[axis] / 2
        how = f"{far:.2f} m beyond" if far > 0 else f"{-far:.2f} m from"
        needed = np.ceil(20 * (np.abs(rig.centers[:, :2]).max(axis=0) + WALL_MARGIN)) / 10
        ring = scenario.cameras.layout in ("ring", "arc")
        smaller = f"cameras.radius at most {_largest_radius(rig, limits):.2f}, or " if ring else ""
        raise ValueError(
            f"{where} is {how} {name} of the room, {x:g} by {y:g} m; expected at least {WALL_MARGIN:g} m inside: use "
            f"{smaller}a larger room.size, {needed[0]:.1f} by {needed[1]:.1f} m or more, or room.walls = false"
        )


def _largest_radius(rig: Rig, limits: NDArray[np.float64]) -> float:
    """Return the largest ring radius, rounded down to a centimetre, with all cameras within limits (2,)."""
    centers = rig.centers[:, :2]
    radius = np.linalg.norm(centers, axis=1, keepdims=True)
    reach = np.abs(centers) / np.maximum(radius, 1e-9)
    return float(np.floor(100 * ((limits / np.maximum(reach, 1e-9)).min() + _ROUNDING)) / 100)
