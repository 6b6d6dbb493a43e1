"""Rig of a scenario: from its camera section to calibrated cameras.

Published rigs are Campus, Shelf, and the sets of Panoptic HD cameras that papers use. Their calibrations are package
data, one file per rig, rounded to a precision of half a pixel in the picture, in the frame of this project: metres, z
up, floor at z = 0, centre of the captured space at the origin. For each camera: focal lengths, principal point and
image size in pixels, distortion k1 k2 p1 p2 k3 (none if absent), position in metres, and rotation from world to camera
as a Rodrigues vector in radians.
"""

import importlib.resources
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.camera import Camera, Rig
from mvpose.files.message_text import prefixed
from mvpose.formats.calibration.calibration_formats import read_calibration, select
from mvpose.formats.detections.plausibility import UNKNOWN_SIZE
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.types.random_streams import stream
from simharness.world.rigs.projection import check_lens, intrinsics

_STEEPEST = 1e-6  # sine of the angle to the vertical below which the upright roll is undefined
_SAME = 1e-9  # metres: closer points are the same
_OFF_CENTER = 0.2  # of a picture: principal points lie nearer to its middle
_NO_TURN = 1e-6  # largest deviation of a rotation matrix from the identity
_WALL_DISTANCE = 0.25  # metres: cameras in the corners of a room
_GOLDEN = 180.0 * (3.0 - np.sqrt(5.0))  # degrees: the golden angle spreads bearings evenly
_LOWEST = 1.0 / 3.0  # lowest cameras of a dome, as a share of its height: people stand below


def build_rig(cameras: CamerasSection, *, seed: int = 0, room: tuple[float, float, float] | None = None) -> Rig:
    """Build the rig of a scenario.

    The cameras of a layout stand at their :func:`camera_positions`, are upright, have square pixels and look at
    ``aim``; ``jitter`` and ``aim_jitter`` are standard deviations of errors of position and aim, drawn from a separate
    stream for each camera. Presets and calibration files are used unchanged.

    Args:
        cameras: camera section of the scenario.
        seed: seed of the scenario.
        room: size x, y, z of the room in metres, for cameras in its corners; None without walls.

    Returns:
        The rig; the cameras of a layout are named "cam0", "cam1", ...

    Raises:
        ValueError: values that do not give a layout, a camera at the point that it looks at, a lens that folds over
            inside the picture, a file that cannot be read, or unknown camera names; the message names the key.
    """
    if "layout" not in cameras.model_fields_set:
        for key, layout in (("preset", "preset"), ("file", "file"), ("positions", "free")):
            if getattr(cameras, key):
                raise ValueError(f"cameras.{key} is given without a layout: add cameras.layout = {layout!r}")
    if cameras.layout == "preset":
        if cameras.preset is None:
            raise ValueError("cameras.layout = 'preset' needs cameras.preset: the name of a published rig")
        rig = preset_rig(cameras.preset, only=cameras.only)
    elif cameras.layout == "file":
        rig = _from_file(cameras)
    else:
        rig = _laid_out(cameras, seed, room)
    where = {"preset": "cameras.preset", "file": cameras.file}.get(cameras.layout, "cameras.distortion")
    for camera in rig:
        with prefixed(where):
            check_lens(camera)
    return rig


def _laid_out(cameras: CamerasSection, seed: int, room: tuple[float, float, float] | None) -> Rig:
    centers = camera_positions(cameras, room=room)
    aims = np.array(cameras.aims if cameras.layout == "free" and cameras.aims else [cameras.aim] * len(centers))
    if len(aims) != len(centers):
        raise ValueError(
            f"cameras.aims has {len(aims)} points and cameras.positions {len(centers)}; expected one aim for every "
            "camera, or none if all look at cameras.aim"
        )
    for k in range(len(centers)):
        centers[k] += cameras.jitter * stream(seed, "cameras", "position", k).standard_normal(3)
        aims[k] += cameras.aim_jitter * stream(seed, "cameras", "aim", k).standard_normal(3)
    K = intrinsics(cameras.fov, cameras.size)
    distortion = np.array(cameras.distortion)
    lens: dict[str, Any] = {"K": K, "size": cameras.size, "distortion": distortion}
    placed = zip(centers, aims, strict=True)
    return Rig([look_at(center, aim, **lens, name=f"cam{k}") for k, (center, aim) in enumerate(placed)])


def _from_file(cameras: CamerasSection) -> Rig:
    if not cameras.file:
        raise ValueError(
            "cameras.layout = 'file' needs cameras.file: a calibration file, relative to the folder of the scenario"
        )
    rig = _sized(read_calibration(cameras.file, size=UNKNOWN_SIZE, only=cameras.only), cameras)
    for camera in rig:
        if np.abs(camera.R - np.eye(3)).max() < _NO_TURN and np.abs(camera.t).max() < _SAME:
            # The world frame is that of one camera, as after stereo calibration: it is placed as camera 0 of a ring.
            bearing = np.radians(cameras.start)
            center = (cameras.radius * np.cos(bearing), cameras.radius * np.sin(bearing), cameras.height)
            return aligned(rig, camera, to=look_at(center, cameras.aim, K=camera.K, size=camera.size))
    return rig


def _sized(rig: Rig, cameras: CamerasSection) -> Rig:
    """Return the rig with the size of pictures that its file does not state.

    Raises:
        ValueError: the default size, where principal points show that it is another one; or a size of the scenario that
            is not that of the file.
    """
    default = cameras.size == CamerasSection.model_fields["size"].default  # stated by quickstart as well
    unknown = [camera.size == UNKNOWN_SIZE for camera in rig]
    for camera, new in zip(rig, unknown, strict=True):
        if not new and not default and camera.size != cameras.size:
            raise ValueError(
                f"cameras.size = {list(cameras.size)} has no effect, because {cameras.file} states {camera.size[0]} x "
                f"{camera.size[1]} for camera {camera.name!r}: remove it, or calibrate for that size"
            )
    if any(unknown) and default:
        middle = 2.0 * np.median([camera.K[:2, 2] for camera in rig], axis=0) + 1.0
        if (np.abs(middle / cameras.size - 1.0) > _OFF_CENTER).any():
            raise ValueError(
                f"{cameras.file}: does not state the size of the pictures, which cannot be {cameras.size[0]} x "
                f"{cameras.size[1]}: principal points are in the middle of about {middle[0]:.0f} x {middle[1]:.0f}; "
                "add cameras.size = [width, height], pixels"
            )
    return Rig([replace(each, size=cameras.size) if new else each for each, new in zip(rig, unknown, strict=True)])


def aligned(rig: Rig, camera: Camera, *, to: Camera) -> Rig:
    """Return the rig moved as a whole such that its ``camera`` has the pose of ``to``."""
    turn = camera.R.T @ to.R  # from the new world frame to the old one
    shift = camera.R.T @ (to.t - camera.t)
    return Rig([replace(each, R=each.R @ turn, t=each.R @ shift + each.t) for each in rig])


def look_at(
    center: ArrayLike,
    aim: ArrayLike,
    *,
    K: ArrayLike,
    size: tuple[int, int],
    distortion: ArrayLike | None = None,
    name: str = "",
) -> Camera:
    """Return the upright camera at ``center`` that looks at ``aim``: image y is down, the horizon is level.

    For a camera exactly above or below its aim, image x is the world x axis.

    Args:
        center: position of the camera, (3,), metres.
        aim: point on its optical axis, (3,), metres.
        K: intrinsics, (3, 3).
        size: width and height in pixels.
        distortion: k1 k2 p1 p2 k3, (5,); none by default.
        name: name of the camera.

    Raises:
        ValueError: position and aim are the same point.
    """
    center, aim = np.asarray(center, float), np.asarray(aim, float)
    forward = aim - center
    distance = float(np.linalg.norm(forward))
    if distance <= _SAME:
        raise ValueError(
            f"camera {name!r} at {center.tolist()} is at the point that it looks at: move cameras.aim or the camera"
        )
    forward /= distance
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) <= _STEEPEST:
        right = np.array([1.0, 0.0, 0.0]) - forward[0] * forward
    right /= np.linalg.norm(right)
    R: NDArray[np.float64] = np.stack([right, np.cross(forward, right), forward])
    terms = np.zeros(5) if distortion is None else np.asarray(distortion, float)
    return Camera(K=np.asarray(K, float), R=R, t=-R @ center, distortion=terms, size=size, name=name)


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


_DATA = importlib.resources.files("simharness.world.rigs") / "data"
_PANOPTIC: dict[str, list[int]] = tomllib.loads((_DATA / "panoptic.toml").read_text(encoding="utf-8"))["sets"]
PRESETS = ("campus", "shelf", *_PANOPTIC)


def preset_rig(name: str, *, only: Sequence[str] = ()) -> Rig:
    """Return a published rig.

    Args:
        name: one of ``PRESETS``.
        only: names of the cameras to use, in this order; all if empty. Those of Panoptic are "00_00" to "00_30".

    Raises:
        ValueError: unknown rig or camera.
    """
    if name not in PRESETS:
        raise ValueError(f"cameras.preset = {name!r} is no published rig; expected one of {', '.join(PRESETS)}")
    file = f"{'panoptic' if name in _PANOPTIC else name}.toml"
    data = tomllib.loads((_DATA / file).read_text(encoding="utf-8"))
    cameras = [_camera(key, entry, data["size"]) for key, entry in data["cameras"].items()]
    if name in _PANOPTIC:
        cameras = [cameras[index] for index in _PANOPTIC[name]]
    return select(cameras, only)


def _camera(name: str, entry: dict[str, Any], size: list[int]) -> Camera:
    (fx, fy), (cx, cy), R = entry["focal"], entry["center"], Rotation.from_rotvec(entry["rotation"]).as_matrix()
    K, lens = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0, 0, 1]]), np.array(entry.get("distortion", np.zeros(5)))
    return Camera(K=K, R=R, t=-R @ np.array(entry["position"]), distortion=lens, size=(size[0], size[1]), name=name)
