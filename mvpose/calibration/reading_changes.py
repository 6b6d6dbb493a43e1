"""Changes of a reading: poses of cameras, maps of pixels, lenses, names of joints; and files that are read again so."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from mvpose.calibration.consistency import Reading
from mvpose.calibration.tracklets import Tracklets
from mvpose.camera import Camera, Rig

Size = tuple[int, int]

Pose = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]
"""From rotation R, translation t and centre C to another rotation and centre."""

Change = Callable[[Floats, Size], tuple[Floats, Floats | None, bool]]
"""From a packed camera (22,) and the size of its pictures to a camera, a map of pixels (2, 3), and whether left and
right are exchanged."""


def changed(reading: Reading, sizes: Sequence[Size], change: Change, views: tuple[int, ...]) -> Reading | None:
    """Return the reading with a change of some views; None where it changes nothing.

    Args:
        reading: the reading before.
        sizes: width and height of the pictures of each camera, pixels.
        change: the change.
        views: cameras that it is applied to.
    """
    cameras, pixels, exchanged = reading.cameras.copy(), reading.pixels.copy(), reading.exchanged.copy()
    for view in views:
        camera, mapped, names = change(cameras[view], sizes[view])
        cameras[view] = camera
        if mapped is not None:
            linear = mapped[:, :2] @ pixels[view]
            linear[:, 2] += mapped[:, 2]
            pixels[view] = linear
        exchanged[view] ^= names
    same = all(
        np.array_equal(a, b)
        for a, b in ((cameras, reading.cameras), (pixels, reading.pixels), (exchanged, reading.exchanged))
    )
    return None if same else Reading(cameras, pixels, exchanged)


# Packed cameras: intrinsics 0 to 4, rotation by rows 5 to 13, centre 14 to 16, distortion 17 to 21.


def _posed(camera: Floats, R: Floats, center: Floats) -> Floats:
    result = camera.copy()
    result[5:14], result[14:17] = R.ravel(), center
    return result


def extrinsics(transform: Pose) -> Change:
    """Return the change of rotation R, translation t and centre C to a rotation and a centre."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        R, center = camera[5:14].reshape(3, 3), camera[14:17]
        return _posed(camera, *transform(R, -R @ center, center)), None, False

    return change


def turned_camera(turn: Floats) -> Pose:
    """Return the turn of the axes of a camera by a matrix (3, 3); it stays in its place."""
    return lambda R, t, C: (turn @ R, C)


def turned_world(turn: Floats) -> Pose:
    """Return the turn of the axes of the world by a matrix (3, 3)."""
    return lambda R, t, C: (R @ turn, turn.T @ C)


def rescaled(scale: float) -> Pose:
    """Return the change of the unit of the world."""
    return lambda R, t, C: (R, scale * C)


def mapped_pixels(matrix: Callable[[int, int], Sequence[Sequence[float]]], exchanged: bool = False) -> Change:
    """Return the change of pixels by an affine map that depends on the size of the pictures."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        return camera, np.array(matrix(*size), float), exchanged

    return change


def other_lens(terms: Callable[[Floats], Floats]) -> Change:
    """Return the change of the distortion terms (5,) of a camera."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        result = camera.copy()
        result[17:22] = terms(camera[17:22])
        return result, None, False

    return change


def exchanged_sides(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
    """Exchange the names of left and right joints."""
    return camera, None, True


def shifted_picture(dx: float, dy: float) -> Change:
    """Return the change of pixels by shares of the width and the height of the picture."""
    return mapped_pixels(lambda w, h: [[1, 0, dx * w], [0, 1, dy * h]])


def turned_by_picture(dx: float, dy: float) -> Change:
    """Return the turn of a camera that moves the centre of its picture by shares of the width and the height."""

    def change(camera: Floats, size: Size) -> tuple[Floats, Floats | None, bool]:
        fx, _, cx, fy, cy = camera[:5]
        middle = 0.5 * np.array(size, float)
        now, then = (
            np.array([(x - cx) / fx, (y - cy) / fy, 1.0]) for x, y in (middle, middle + np.array([dx, dy]) * size)
        )
        turn = Rotation.align_vectors(now[None] / np.linalg.norm(now), then[None] / np.linalg.norm(then))[0]
        return _posed(camera, turn.as_matrix() @ camera[5:14].reshape(3, 3), camera[14:17]), None, False

    return change


def scaled_picture(factor: float) -> Change:
    """Return the change of pixels to those of pictures that are ``factor`` times as large."""
    # The centre of the first pixel is at 0, its corner at -0.5.
    offset = 0.5 * (factor - 1.0)
    return mapped_pixels(lambda w, h: [[factor, 0, offset], [0, factor, offset]])


def reread_rig(rig: Rig, reading: Reading) -> Rig | None:
    """Return the rig as a reading has it; None if it is no rig."""
    cameras = []
    try:
        for camera, row in zip(rig, reading.cameras, strict=True):
            fx, skew, cx, fy, cy = row[:5]
            R = row[5:14].reshape(3, 3)
            K = np.array([[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
            cameras.append(Camera(K, R, -R @ row[14:17], row[17:22], camera.size, camera.name, camera.readout))
        return Rig(cameras)
    except ValueError:
        return None


def reread_tracklets(tracklets: Tracklets, reading: Reading) -> Tracklets:
    """Return tracklets in the pixels and with the joint names of a reading."""
    keypoints, sigma, velocity = tracklets.keypoints.copy(), tracklets.sigma.copy(), tracklets.velocity.copy()
    mirror = list(tracklets.skeleton.mirror)
    for view, (matrix, exchanged) in enumerate(zip(reading.pixels, reading.exchanged, strict=True)):
        rows = np.flatnonzero(tracklets.view == view)
        keypoints[rows] = keypoints[rows] @ matrix[:, :2].T + matrix[:, 2]
        velocity[rows] = velocity[rows] @ matrix[:, :2].T
        sigma[rows] *= np.sqrt(abs(np.linalg.det(matrix[:, :2])))
        if exchanged:
            for array in (keypoints, sigma, velocity):
                array[rows] = array[rows][:, mirror]
    return replace(tracklets, keypoints=keypoints, sigma=sigma, velocity=velocity)
