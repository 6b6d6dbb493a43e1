"""Rig of a scenario: from its camera section to calibrated cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.camera import Camera, Rig
from mvpose.formats.calibration.calibration_formats import read_calibration
from mvpose.formats.detections.plausibility import UNKNOWN_SIZE
from simharness.scenario.sections.cameras_section import CamerasSection
from simharness.types.random_streams import stream
from simharness.world.rigs.camera_positions import camera_positions
from simharness.world.rigs.lenses import check_lens, intrinsics
from simharness.world.rigs.published_rigs import preset_rig

_STEEPEST = 1e-6  # sine of the angle to the vertical below which the upright roll is undefined
_SAME = 1e-9  # metres: closer points are the same
_OFF_CENTER = 0.2  # of a picture: principal points lie nearer to its middle
_NO_TURN = 1e-6  # largest deviation of a rotation matrix from the identity


def build_rig(cameras: CamerasSection, *, seed: int = 0, room: tuple[float, float, float] | None = None) -> Rig:
    """Build the rig of a scenario.

    The cameras of a layout stand at the positions of
    :func:`simharness.world.rigs.camera_positions.camera_positions`, are upright, have square pixels and look at
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
        try:
            check_lens(camera)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
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
    return Rig(
        [
            look_at(center, aim, K=K, size=cameras.size, distortion=distortion, name=f"cam{k}")
            for k, (center, aim) in enumerate(zip(centers, aims, strict=True))
        ]
    )


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
