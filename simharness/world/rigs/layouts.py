"""Camera layouts: from the section of a scenario to a calibrated rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.camera import Camera, Rig
from simharness.formats.calibration.registry import read_calibration
from simharness.scenario.sections.scenario import Cameras
from simharness.types.random_streams import stream
from simharness.world.rigs.camera_positions import places
from simharness.world.rigs.lenses import check_lens, intrinsics
from simharness.world.rigs.presets import preset_rig

_STEEPEST = 1e-6  # sine of the angle to the vertical below which a camera has no upright roll
_SAME = 1e-9  # metres
_NO_TURN = 1e-6  # of a rotation matrix' elements


def build_rig(cameras: Cameras, *, seed: int = 0, room: tuple[float, float, float] | None = None) -> Rig:
    """Place the cameras of a scenario.

    :func:`simharness.world.rigs.camera_positions.places` says where those of a layout stand. They are upright, have square pixels
    and look at ``aim``; ``jitter`` and ``aim_jitter`` draw how far off each stands and looks, from streams of that
    camera. Presets and calibrations in files are taken as they are.

    Args:
        cameras: the section of the scenario.
        seed: of the scenario.
        room: its x, y, z, metres, for cameras in its corners; None: it has no walls.

    Returns:
        The rig; the cameras of a layout are named "cam0", "cam1", ...

    Raises:
        ValueError: numbers that make no layout, a camera that stands in what it looks at, a lens that folds over
            within the picture, a file that cannot be read, names that the rig has not; the message names the key.
    """
    if "layout" not in cameras.model_fields_set:
        for key, layout in (("preset", "preset"), ("file", "file"), ("positions", "free")):
            if getattr(cameras, key):
                raise ValueError(f"cameras.{key} is given, but no layout: add cameras.layout = {layout!r}")
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
        try:
            check_lens(camera)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
    return rig


def _laid_out(cameras: Cameras, seed: int, room: tuple[float, float, float] | None) -> Rig:
    centers = places(cameras, room=room)
    aims = np.array(cameras.aims if cameras.layout == "free" and cameras.aims else [cameras.aim] * len(centers))
    if len(aims) != len(centers):
        raise ValueError(
            f"cameras.aims has {len(aims)} points and cameras.positions {len(centers)}; expected one aim for every "
            "camera, or none where all look at cameras.aim"
        )
    for k in range(len(centers)):
        centers[k] += cameras.jitter * stream(seed, "cameras", "position", k).standard_normal(3)
        aims[k] += cameras.aim_jitter * stream(seed, "cameras", "aim", k).standard_normal(3)
    K = intrinsics(cameras.fov, cameras.size)
    distortion = np.array(cameras.distortion)
    return Rig(
        [
            look_at(center, aim, K=K, size=cameras.size, distortion=distortion, name=f"cam{k}")
            for k, (center, aim) in enumerate(zip(centers, aims, strict=True))
        ]
    )


def _from_file(cameras: Cameras) -> Rig:
    if not cameras.file:
        raise ValueError("cameras.layout = 'file' needs cameras.file: a calibration, relative to the scenario's folder")
    rig = read_calibration(cameras.file, size=cameras.size, only=cameras.only)
    for camera in rig:
        if np.abs(camera.R - np.eye(3)).max() < _NO_TURN and np.abs(camera.t).max() < _SAME:
            # The world is that camera's, as a stereo calibration leaves it: it hangs where a ring's first one would.
            bearing = np.radians(cameras.start)
            center = (cameras.radius * np.cos(bearing), cameras.radius * np.sin(bearing), cameras.height)
            return carried(rig, camera, to=look_at(center, cameras.aim, K=camera.K, size=camera.size))
    return rig


def carried(rig: Rig, camera: Camera, *, to: Camera) -> Rig:
    """The rig moved as a whole so that ``camera``, one of it, stands and looks as ``to`` does."""
    turn = camera.R.T @ to.R  # from the new world to the old
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

    A camera straight above or below its aim has no horizon: its image x is the world's.

    Args:
        center: where the camera stands, (3,), metres.
        aim: the point on its optical axis, (3,), metres.
        K: intrinsics, (3, 3).
        size: width and height in pixels.
        distortion: k1 k2 p1 p2 k3, (5,); none by default.
        name: the camera's name.

    Raises:
        ValueError: the camera stands in the point.
    """
    center, aim = np.asarray(center, float), np.asarray(aim, float)
    forward = aim - center
    distance = float(np.linalg.norm(forward))
    if distance <= _SAME:
        raise ValueError(
            f"camera {name!r} at {center.tolist()} stands in the point that it looks at: move cameras.aim or the camera"
        )
    forward /= distance
    right = np.cross(forward, [0.0, 0.0, 1.0])
    if np.linalg.norm(right) <= _STEEPEST:
        right = np.array([1.0, 0.0, 0.0]) - forward[0] * forward
    right /= np.linalg.norm(right)
    R: NDArray[np.float64] = np.stack([right, np.cross(forward, right), forward])
    terms = np.zeros(5) if distortion is None else np.asarray(distortion, float)
    return Camera(K=np.asarray(K, float), R=R, t=-R @ center, distortion=terms, size=size, name=name)
