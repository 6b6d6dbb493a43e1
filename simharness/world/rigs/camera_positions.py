"""Camera positions of the layouts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mvpose.arrays import Floats
from simharness.scenario.sections.cameras_section import CamerasSection

_WALL_DISTANCE = 0.25  # metres: cameras in the corners of a room
_GOLDEN = 180.0 * (3.0 - np.sqrt(5.0))  # degrees: the golden angle spreads bearings evenly
_LOWEST = 1.0 / 3.0  # lowest cameras of a dome, as a share of its height: people stand below


def camera_positions(cameras: CamerasSection, *, room: tuple[float, float, float] | None = None) -> Floats:
    """Return the positions of the cameras of a layout, without jitter.

    Bearings are counter-clockwise from the x axis as seen from above; ``start`` is the first one.

    - ring: camera k at the bearing ``start + 360 k / count``, ``radius`` from the z axis;
    - arc: evenly spaced from ``start`` to ``start + spread`` on the same circle, both ends included;
    - line: ``spacing`` apart, perpendicular to the bearing ``start`` at distance ``radius``, from right to left as seen
      from the z axis;
    - corners: corners of the room, 0.25 m from its walls, or of the square of half side ``radius`` without a room;
      after four cameras the middles of the walls, then the quarters, and so on;
    - dome: on the half ellipsoid on the floor with radius ``radius`` and height ``height``, evenly by area from a third
      of the height to the top, each rotated by the golden angle from the one below (or at ``heights``);
    - pairs: two cameras side by side, ``spacing`` apart, at each position of a ring;
    - free: ``positions``.

    Args:
        cameras: camera section of the scenario.
        room: size x, y, z of the room, metres; None without walls.

    Returns:
        Positions, (n, 3), metres.

    Raises:
        ValueError: values that do not give such a layout; the message names the key.
    """
    if cameras.layout == "free":
        if not cameras.positions:
            raise ValueError("cameras.layout = 'free' needs cameras.positions: one [x, y, z] in metres per camera")
        return np.array(cameras.positions)
    count = cameras.count
    if count < 2:
        raise ValueError(f"cameras.count = {count}: expected at least 2, because triangulation needs 2 cameras")
    if cameras.layout == "dome":
        return _dome(cameras)
    if cameras.layout == "corners":
        half = np.array([cameras.radius, cameras.radius] if room is None else room[:2])
        flat = _corners(count, half if room is None else half / 2 - _WALL_DISTANCE)
    else:
        flat = _FLAT[cameras.layout](cameras)
    return np.column_stack([flat, _heights(cameras)])


def _heights(cameras: CamerasSection) -> Floats:
    return np.resize(np.array(cameras.heights or (cameras.height,)), cameras.count)


def _at(bearings: Floats, radius: float | Floats) -> Floats:
    """Return points (n, 2) at bearings (n,), degrees."""
    angles = np.radians(bearings)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])


def _ring(cameras: CamerasSection) -> Floats:
    return _at(cameras.start + 360.0 * np.arange(cameras.count) / cameras.count, cameras.radius)


def _arc(cameras: CamerasSection) -> Floats:
    if cameras.spread == 360.0:
        raise ValueError(
            "cameras.spread = 360 puts the last camera of the arc on the first: use cameras.layout = 'ring' or a "
            "smaller cameras.spread"
        )
    return _at(cameras.start + cameras.spread * np.arange(cameras.count) / (cameras.count - 1), cameras.radius)


def _line(cameras: CamerasSection) -> Floats:
    ahead, left = _at(np.array([cameras.start, cameras.start + 90.0]), 1.0)
    along = cameras.spacing * (np.arange(cameras.count) - (cameras.count - 1) / 2)
    return cameras.radius * ahead + along[:, None] * left


def _pairs(cameras: CamerasSection) -> Floats:
    if cameras.count % 2:
        raise ValueError(f"cameras.count = {cameras.count}: pairs need an even number of cameras")
    pairs = cameras.count // 2
    bearings = cameras.start + 360.0 * np.arange(pairs) / pairs
    half = cameras.spacing / 2 * _at(bearings + 90.0, 1.0)
    middles = _at(bearings, cameras.radius)
    return np.stack([middles - half, middles + half], axis=1).reshape(-1, 2)


_FLAT: dict[str, Callable[[CamerasSection], Floats]] = {"ring": _ring, "arc": _arc, "line": _line, "pairs": _pairs}


def _corners(count: int, half: Floats) -> Floats:
    """Return points on a rectangle of half sides (2,): corners, then middles of the sides, then quarters, ..."""
    if (half <= 0).any():
        raise ValueError(f"room.size is too small for cameras.layout = 'corners', {_WALL_DISTANCE:g} m from the walls")
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    shares, steps = [0.0], 2
    while 4 * len(shares) < count:
        shares += [odd / steps for odd in range(1, steps, 2)]
        steps *= 2
    points = [corners + share * (np.roll(corners, -1, axis=0) - corners) for share in shares]
    return np.concatenate(points)[:count]


def _dome(cameras: CamerasSection) -> Floats:
    top, count = cameras.height, cameras.count
    if top <= 0:
        raise ValueError(f"cameras.height = {top:g}: a dome needs a height above 0 m")
    if cameras.heights and max(cameras.heights) > top:
        raise ValueError(
            f"cameras.heights reaches {max(cameras.heights):g} m, above the top of the dome at cameras.height = "
            f"{top:g} m: use a larger cameras.height"
        )
    z = _heights(cameras) if cameras.heights else top * (_LOWEST + (1 - _LOWEST) * np.arange(count) / (count - 1))
    radius = cameras.radius * np.sqrt(np.maximum(1.0 - (z / top) ** 2, 0.0))
    return np.column_stack([_at(cameras.start + _GOLDEN * np.arange(count), radius), z])
