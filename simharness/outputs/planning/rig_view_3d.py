"""3D view of a rig: frusta of the cameras, the volume, and the part of it that meets the target."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.report.view_3d import (
    PYRAMID,
    Piece3D,
    Scene3D,
    Shape3D,
    Style3D,
    View3D,
    camera_pyramid,
    loop,
    prism,
    view_3d,
)
from simharness.outputs.planning.rehearsal_plots import EXTRA, GOOD, outline_of
from simharness.planning.floor_coverage import grid_spacing
from simharness.planning.rehearsal_result import Rehearsal

_REACH = 1.4  # metres: length of the drawn frusta
_FRUSTUM, _EXTRA = Style3D("--accent", 1.1), Style3D(EXTRA, 1.3)
_VOLUME, _OBSTACLE, _ROOM = Style3D("--ink", 1.2), Style3D("--faint", 1.0), Style3D("--faint", 2.0)
_TILE, _OUTLINE, _GRID = Style3D(GOOD, opacity=0.22), Style3D(GOOD, 1.8), Style3D("--line", 1.0)


def rig_view_3d(rehearsal: Rehearsal) -> View3D:
    """Return the view of a rehearsal."""
    rig, setup = rehearsal.rig, rehearsal.setup
    volume, height = setup.volume.outline, setup.volume.height
    walls = np.zeros((0, 2)) if setup.space is None else setup.space.outline
    points = np.concatenate([volume, rig.centers[:, :2], walls])
    frusta = [Piece3D(camera_pyramid(camera, _REACH), PYRAMID, _FRUSTUM) for camera in rig]
    if rehearsal.extra is not None:
        frusta.append(Piece3D(camera_pyramid(rehearsal.extra.camera, _REACH), PYRAMID, _EXTRA))
    room = _at(walls, 0.0)
    floor = _floor(points)
    scene = Scene3D(
        label="The rig in 3D: frusta of the cameras, the volume, and the part of it that meets the target in green",
        center=np.array([*(points.min(axis=0) + points.max(axis=0)) / 2, height / 2]),
        fitted=np.concatenate([rig.centers, _at(volume, height), *floor]),
        fixed=[
            *_tiles(rehearsal),
            Piece3D.of_lines(floor, _GRID),
            Piece3D(room, Shape3D(lines=loop(len(room))), _ROOM),
            *(Piece3D(each.corners[[0, 4, 6, 2, 1, 5, 7, 3]], prism(4), _OBSTACLE) for each in setup.obstacles),
            Piece3D(np.concatenate([_at(volume, 0.0), _at(volume, height)]), prism(len(volume)), _VOLUME),
            Piece3D.of_lines(_upright(outline_of(rehearsal.prediction.places, rehearsal.good), height), _OUTLINE),
            *frusta,
        ],
        names=[(camera.name, camera.center) for camera in rig],
    )
    return view_3d(scene)


def _at(outline: Floats, height: float) -> Floats:
    """Return points of the floor (n, 2) at a height, (n, 3)."""
    return np.column_stack([outline, np.full(len(outline), height)])


def _tiles(rehearsal: Rehearsal) -> list[Piece3D]:
    """Return the places that meet the target as squares of the floor."""
    places = rehearsal.prediction.places
    corner = grid_spacing(places) / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    square = Shape3D(faces=(tuple(range(4)),))
    return [Piece3D(_at(place + corner, 0.0), square, _TILE) for place in places[rehearsal.good]]


def _upright(lines: list[Floats], height: float) -> list[Floats]:
    """Return lines of the floor on the floor and at a height, with posts where they turn."""
    corners = {tuple(np.round(end, 6)) for line in lines for end in line}
    turning = {
        corner
        for corner in corners
        if len({tuple(np.abs(np.sign(np.round(line[1] - line[0], 6)))) for line in lines if _ends(line, corner)}) > 1
    }
    posts = [np.array([[*corner, 0.0], [*corner, height]]) for corner in sorted(turning)]
    return [*(_at(line, level) for line in lines for level in (0.0, height)), *posts]


def _ends(line: Floats, corner: tuple[float, ...]) -> bool:
    return any(np.allclose(end, corner, atol=1e-5) for end in line)


def _floor(points: Floats) -> list[Floats]:
    """Return the lines of a grid of one metre under points (n, 2)."""
    (left, front), (right, back) = np.floor(points.min(axis=0)), np.ceil(points.max(axis=0))
    across = [np.array([[x, front, 0.0], [x, back, 0.0]]) for x in np.arange(left, right + 0.5)]
    return across + [np.array([[left, y, 0.0], [right, y, 0.0]]) for y in np.arange(front, back + 0.5)]
