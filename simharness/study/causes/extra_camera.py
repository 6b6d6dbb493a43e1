"""Place of one more camera for a rig: in the widest gap between the bearings of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from simharness.world.rigs.layouts import look_at
from simharness.world.scene.camera_clearance import WALL_MARGIN
from simharness.world.scene.objects.solids import Solid

_CLEARANCE = 0.3  # metres from the nearest thing
_PARALLEL = 1e-3  # weight of a point ahead of the cameras, which counts where all look the same way


def with_one_more_camera(rig: Rig, solids: Sequence[Solid], *, room: tuple[float, float, float] | None) -> Rig:
    """Return the rig with one more camera behind the others, which stay as they are.

    It stands in the middle of the widest gap between the bearings of the cameras, as far away and as high as they are
    (medians), looks at the point at which they look, and has the lens and the picture of the first. If a thing stands
    there, the next widest gap is taken; if things stand in all gaps, the widest.

    Args:
        rig: the V cameras.
        solids: room and things of the scene.
        room: size x, y, z of the room, metres, where it has walls.
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
        if room is not None:
            limit = np.array(room) / [2, 2, 1] - WALL_MARGIN
            place = np.clip(place, [*-limit[:2], 0.0], limit)
        places.append(place)
    free = [place for place in places if _is_free(place, solids)]
    return Rig([*rig, _camera(rig, (free or places)[0], aim)])


def _aim(rig: Rig) -> Floats:
    """Return the point nearest to all optical axes, (3,), metres."""
    axes = np.stack([camera.R[2] for camera in rig])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]  # projection to the plane perpendicular to an axis
    ahead = (rig.centers + 4.0 * axes).mean(axis=0)
    normal = across.sum(axis=0) + _PARALLEL * np.eye(3)
    return np.linalg.solve(normal, (across @ rig.centers[:, :, None]).sum(axis=0)[:, 0] + _PARALLEL * ahead)


def _is_free(place: Floats, solids: Sequence[Solid]) -> bool:
    return all(
        solid.hull.distance(place) > _CLEARANCE for solid in solids if solid.kind != "room" and solid.trajectory is None
    )


def _camera(rig: Rig, place: Floats, aim: Floats) -> Camera:
    first, taken = rig[0], {camera.name for camera in rig}
    name = next(name for k in range(len(rig), 2 * len(rig) + 2) if (name := f"cam{k}") not in taken)
    return replace(look_at(place, aim, K=first.K, size=first.size, name=name), distortion=first.distortion)
