"""Checks that the detections of a recording can belong to the cameras of a calibration.

What is certainly wrong is refused here, before anything is estimated; what only the geometry of people can tell
(cameras that moved, exchanged views, conventions) is the part of :mod:`mvpose.calibration`.
"""

from dataclasses import replace

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Rig

UNKNOWN_SIZE = (1, 1)
"""Marks cameras of files that do not state the size of the pictures: no picture has it."""

_NORMALISED = 2.0  # pixels; keypoints in units of the picture's width lie in 0..1, up to a person who is cut off
_BESIDE = 0.1  # of a picture: detectors place joints of people who are cut off this far beside it
_MIDDLE = 0.15  # of a picture, from its middle to the principal point; of real cameras up to .05
_UPRIGHT = 0.7  # length of the mean of the cameras' upward directions where they stand upright
_AXES = ("x", "y", "z", "-x", "-y", "-z")


def with_sizes(rig: Rig, extents: Floats, *, size: tuple[int, int] | None = None) -> tuple[Rig, str]:
    """Return the rig with the sizes of pictures that its file does not state.

    A given ``size`` holds for these cameras. Without one, the pictures are taken to be the smallest that hold all
    keypoints and whose middle is the median principal point; all cameras get the same size.

    Args:
        rig: cameras, of which some have :data:`UNKNOWN_SIZE`.
        extents: region of the keypoints, (V, 2, 2), :meth:`.RecordedFrames.extents`.
        size: width and height, pixels.

    Returns:
        The rig, and a note for the user about sizes that were derived; "" where none were.
    """
    unknown = [camera.size == UNKNOWN_SIZE for camera in rig]
    if not any(unknown):
        return rig, ""
    note = ""
    if size is None:
        middle = np.median([camera.K[:2, 2] for camera in rig], axis=0)
        reach = np.nanmax(extents[:, 1], axis=0) if np.isfinite(extents).any() else middle
        width, height = np.ceil(np.maximum(2.0 * middle, reach)).astype(int) + 1
        size = int(width), int(height)
        note = (
            f"the calibration does not state the size of the pictures: taken as {width} x {height}, from principal "
            "points and keypoints; --size WIDTHxHEIGHT states it"
        )
    return Rig.unchecked(
        [replace(each, size=size) if new else each for each, new in zip(rig, unknown, strict=True)]
    ), note


def check_size(rig: Rig, size: tuple[int, int]) -> None:
    """Check that a given size can be that of the pictures.

    Args:
        rig: cameras of the calibration, some of :data:`UNKNOWN_SIZE`.
        size: width and height, pixels.

    Raises:
        ValueError: the calibration states another size, or principal points are far from the middle of such pictures.
    """
    given = f"--size {size[0]}x{size[1]}"
    for camera in rig:
        if camera.size not in (UNKNOWN_SIZE, size):
            raise ValueError(
                f"{given}: the calibration states {camera.size[0]}x{camera.size[1]} for the pictures of camera "
                f"{camera.name!r}, which is used: leave --size out, or correct the calibration"
            )
    x, y = np.median([camera.K[:2, 2] for camera in rig], axis=0)
    if (np.abs(np.array([x, y]) / size - 0.5) > _MIDDLE).any():
        raise ValueError(
            f"{given}: the principal points are at {x:.0f}, {y:.0f}, far from the middle of such pictures: those of "
            f"the calibration have about {2 * x:.0f} x {2 * y:.0f} pixels; if they are cut out of larger ones, state "
            "their size in the calibration"
        )


def check_principal_points(rig: Rig) -> None:
    """Check that the principal point of every camera lies in its picture, and not in the middle of a turned one.

    Raises:
        ValueError: one that does not; the message names the camera.
    """
    for camera in rig:
        own, turned = (np.abs(camera.K[:2, 2] / size - 0.5).max() for size in (camera.size, camera.size[::-1]))
        if turned < _MIDDLE / 2 < _MIDDLE < own:
            raise ValueError(
                f"camera {camera.name!r}: its pictures are {camera.size[0]} x {camera.size[1]} pixels, but the "
                f"principal point is in the middle of {camera.size[1]} x {camera.size[0]}: width and height of the "
                "calibration are exchanged"
            )
        x, y = camera.K[:2, 2]
        if not (0.0 <= x < camera.size[0] and 0.0 <= y < camera.size[1]):
            raise ValueError(
                f"camera {camera.name!r}: the principal point ({x:.6g}, {y:.6g}) lies outside its picture of "
                f"{camera.size[0]} x {camera.size[1]} pixels; the calibration is of another picture size, K is "
                "transposed, or it is in other units than pixels"
            )


def check_extents(rig: Rig, extents: Floats) -> None:
    """Check that keypoints are in pixels of the pictures for which the cameras were calibrated.

    Args:
        rig: cameras with the sizes of their pictures.
        extents: region of the keypoints of each camera, (V, 2, 2).

    Raises:
        ValueError: normalised keypoints, or keypoints far outside of the pictures; the message names the camera.
    """
    known = np.isfinite(extents).all(axis=(1, 2))
    if known.any() and (np.abs(extents[known]).max(axis=(1, 2)) < _NORMALISED).any():
        view = int(np.flatnonzero(known & (np.nan_to_num(np.abs(extents)).max(axis=(1, 2)) < _NORMALISED))[0])
        raise ValueError(
            f"camera {rig[view].name!r}: the keypoints lie between {extents[view].min():.3g} and "
            f"{extents[view].max():.3g}: they are normalised; expected pixels: multiply x by the width and y by the "
            "height of the pictures"
        )
    for camera, region in zip(rig, extents, strict=True):
        width, height = camera.size
        (left, top), (right, bottom) = region
        if right > (1 + _BESIDE) * width or bottom > (1 + _BESIDE) * height:
            raise ValueError(
                f"camera {camera.name!r}: keypoints reach {right:.0f}, {bottom:.0f}, beyond its picture of {width} x "
                f"{height} pixels: the calibration is of another picture size than the detections; detect in "
                "pictures of the calibrated size, or scale the intrinsics"
            )
        if left < -_BESIDE * width or top < -_BESIDE * height:
            raise ValueError(
                f"camera {camera.name!r}: keypoints reach {left:.0f}, {top:.0f}, far outside its picture; expected "
                "pixels from the upper left corner"
            )


def up_axis(rig: Rig) -> str | None:
    """Return the axis of the world that points up: "z", "-y" ..., as the cameras stand; None where they do not agree.

    Cameras stand upright nearly everywhere, so the mean of their upward directions (minus the y axis of the picture)
    points up; the directions of cameras that are rolled by a quarter, or look straight down, cancel each other out.
    """
    mean = -np.mean([camera.R[1] for camera in rig], axis=0)
    if np.linalg.norm(mean) < _UPRIGHT:
        return None
    return _AXES[int(np.argmax(np.concatenate([mean, -mean])))]


def turned_up(rig: Rig, up: str) -> Rig:
    """Return the rig in a world whose z axis points up, given the axis of its own world that does.

    The axes are exchanged in a cycle (y up: x becomes y, y becomes z, z becomes x), and turned by half for a negative
    axis.

    Raises:
        ValueError: no axis.
    """
    if up not in _AXES:
        raise ValueError(f"--up must be one of {', '.join(_AXES)}, got {up!r}")
    axis = _AXES.index(up) % 3
    axes = np.roll(np.eye(3), 2 - axis, axis=1)  # x_file = axes x_ours: the third column is the upward axis
    if up.startswith("-"):
        axes = axes @ np.diag([1.0, -1.0, -1.0])
    return Rig([replace(camera, R=camera.R @ axes) for camera in rig])


def check_up(rig: Rig) -> None:
    """Check that z points up.

    Raises:
        ValueError: the cameras stand upright along another axis.
    """
    up = up_axis(rig)
    if up not in (None, "z"):
        raise ValueError(
            f"the cameras stand upright where the {up} axis of the world points up; expected z. If this is so, give "
            f"--up={up}; if z does point up, the rotations are of other conventions (camera to world, other camera "
            "axes): `mvpose doctor` says which; --up=z takes the calibration as it is"
        )
