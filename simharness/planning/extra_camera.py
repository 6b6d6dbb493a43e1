"""Places for one more camera: on the walls of the room, or around the cameras that are there, looking at the volume."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from simharness.planning.volume import Volume
from simharness.world.rigs.layouts import look_at

_AIM = 1.0  # metres: height at which cameras look
_FROM_WALL = 0.15  # metres
_HIGH = 2.5  # metres: a camera that nobody walks into
_BELOW_CEILING = 0.2  # metres
_BEYOND = 0.5  # metres from the volume, where the room is unknown
_TAKEN = 0.4  # metres: no second camera at the place of another


def candidate_cameras(rig: Rig, volume: Volume, *, room: Volume | None = None, around: int = 16) -> list[Camera]:
    """Return cameras that could be added, all with the lens of the rig's first camera, aimed at the volume's middle.

    They are at the median height of the rig and at 2.5 m, below the ceiling.

    Args:
        rig: the cameras that are there.
        volume: where people are.
        room: floor and height of the room; None: the rectangle around the cameras and the volume.
        around: number of places on its walls, evenly spaced from a corner on.
    """
    middle = volume.outline.mean(axis=0)
    ceiling = np.inf if room is None else room.height - _BELOW_CEILING
    heights = sorted({round(min(height, ceiling), 2) for height in (float(np.median(rig.centers[:, 2])), _HIGH)})
    lens, found = rig[0], []
    for place in _around(_outline(rig, volume, room), middle, around):
        for height in heights:
            center = np.array([*place, height])
            if np.linalg.norm(rig.centers - center, axis=1).min() < _TAKEN:
                continue
            camera = look_at(
                center, (*middle, _AIM), K=lens.K, size=lens.size, distortion=lens.distortion, name="one more"
            )
            found.append(replace(camera, readout=lens.readout))
    return found


def _outline(rig: Rig, volume: Volume, room: Volume | None) -> Floats:
    if room is not None:
        return room.outline
    points = np.concatenate([rig.centers[:, :2], volume.outline - _BEYOND, volume.outline + _BEYOND])
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
