"""Lens distortion: pictures of a pinhole camera with the same field of view, warped to the lens.

The pinhole picture covers every direction that the lens images and has at least the resolution of the distorted one
everywhere. Colours are interpolated; ids and parts are those of the nearest pixel, less than 0.75 pixels of the
distorted picture away from the exact position; depth is that of the surface there, along the exact ray.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Camera
from mvpose.kernels import njit
from simharness.capture.rendering.renderer import Image
from simharness.world.rigs.projection import project_to_image, undistorted

_MAX_PIXEL_RATIO = 16.0  # pixels of the pinhole picture per pixel of the distorted one
_MARGIN = 1  # pixels around the pinhole picture, for interpolation
_LONGEST_SIDE = 16384  # pixels, limit of OpenGL
_SAMPLES = 64  # samples of the magnification along each side; it changes smoothly
_BAND = 64  # rows that are undistorted at once: whole pictures would take several times the memory of the lens
_STEEPEST = 0.1  # relative change of depth from pixel to pixel of one surface: a floor ten rows below the horizon
_KEPT = 64  # cached lenses: as many as a rig has cameras


@dataclass(frozen=True)
class Lens:
    """Mapping from the picture of a pinhole camera to that of a distorting lens.

    Attributes:
        K: intrinsics of the pinhole camera.
        size: width and height of its picture in pixels.
        columns, rows: position of each pixel of the distorted picture in the pinhole picture, (h, w) float32; far
            outside if the lens images nothing at the pixel.
        nearest: index of the nearest pixel of the flattened pinhole picture, (h, w) int32; 0 if there is none.
        dark: pixels at which the lens images nothing, (h, w) bool; None if there are none.
    """

    K: NDArray[np.float64]
    size: tuple[int, int]
    columns: NDArray[np.float32]
    rows: NDArray[np.float32]
    nearest: NDArray[np.int32]
    dark: NDArray[np.bool_] | None

    def pinhole(self, camera: Camera) -> Camera:
        """Return the pinhole camera that takes the place of a camera with this lens."""
        return replace(camera, K=self.K, distortion=np.zeros(5), size=self.size)

    def distorted(self, image: Image) -> Image:
        """Return the picture through the lens from that of the pinhole camera; black where it images nothing."""
        return Image(
            rgb=self.colors(image.rgb),
            depth=self._depth(image.depth),
            ids=self._picked(image.ids, -1),
            parts=None if image.parts is None else self._picked(image.parts, -1),
        )

    def colors(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the colours (h, w, 3) through the lens from those of the pinhole camera, else black."""
        bent = cv2.remap(rgb, self.columns, self.rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return bent.astype(np.uint8, copy=False)

    def _depth(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        result = _depth_at(depth, self.columns, self.rows, self.nearest)
        if self.dark is not None:
            result[self.dark] = np.inf
        return result

    def _picked(self, values: NDArray, empty: float) -> NDArray:
        result = values.ravel()[self.nearest]
        if self.dark is not None:
            result[self.dark] = empty
        return result


@njit(cache=True)
def _depth_at(depth, columns, rows, nearest):
    """Return the depth at positions in the picture of a pinhole camera, that of the surface at the nearest pixel.

    The inverse of the depth of a plane is linear in the picture. Its slope at a pixel is, along each axis, the smaller
    difference to a neighbour, because the other may be another surface; where both differ much, it is not known, and
    the depth is that of the pixel.

    Args:
        depth: picture of the pinhole camera, (H, W), metres; infinite where there is no surface.
        columns: see :class:`Lens`.
        rows: see :class:`Lens`.
        nearest: see :class:`Lens`.
    """
    height, width = depth.shape
    result = np.empty(nearest.shape, depth.dtype)
    for i in range(nearest.shape[0]):
        for j in range(nearest.shape[1]):
            row, column = nearest[i, j] // width, nearest[i, j] % width
            inverse = 1.0 / depth[row, column]
            moved = inverse
            if inverse > 0.0:
                for down, right, way in ((0, 1, columns[i, j] - column), (1, 0, rows[i, j] - row)):
                    slope = _STEEPEST * inverse
                    for side in (-1, 1):
                        y, x = row + side * down, column + side * right
                        if 0 <= y < height and 0 <= x < width and depth[y, x] < np.inf:
                            step = side * (1.0 / depth[y, x] - inverse)
                            slope = step if abs(step) < abs(slope) else slope
                    moved += slope * way if abs(slope) < _STEEPEST * inverse else 0.0
            result[i, j] = 1.0 / moved if moved > 0.0 else np.inf
    return result


def through_lens(camera: Camera, picture: Callable[[Camera], Image]) -> Image:
    """Render a picture through the lens of a camera, given a function that renders pictures of pinhole cameras.

    Raises:
        ValueError: see :func:`lens_of`.
    """
    if not camera.distortion.any():
        return picture(camera)
    lens = lens_of(camera)
    return lens.distorted(picture(lens.pinhole(camera)))


def lens_of(camera: Camera) -> Lens:
    """Return the lens of a camera; cached by intrinsics, independent of the pose of the camera.

    Raises:
        ValueError: the lens distorts so much that the pinhole picture would be too large.
    """
    lens = _lens(camera.K.tobytes(), camera.distortion.tobytes(), camera.size)
    if isinstance(lens, str):
        raise ValueError(f"camera {camera.name!r}: {lens}")
    return lens


@lru_cache(maxsize=_KEPT)
def _lens(K_bytes: bytes, distortion_bytes: bytes, size: tuple[int, int]) -> Lens | str:
    """Return the lens, or a message if it cannot be rendered."""
    K, distortion = np.frombuffer(K_bytes).reshape(3, 3), np.frombuffer(distortion_bytes)
    camera = Camera(K, np.eye(3), np.zeros(3), distortion=distortion, size=size)
    width, height = size
    bands = [slice(top, min(top + _BAND, height)) for top in range(0, height, _BAND)]
    straight, imaged = np.empty((height, width, 2)), np.empty((height, width), np.bool_)
    for band in bands:
        pixels = np.stack(np.meshgrid(np.arange(width), np.arange(band.start, band.stop)), axis=-1).astype(float)
        straight[band] = undistorted(camera, pixels)
        imaged[band] = np.isfinite(straight[band].sum(axis=-1))
    low = np.min(straight, axis=(0, 1), where=imaged[..., None], initial=np.inf)
    high = np.max(straight, axis=(0, 1), where=imaged[..., None], initial=-np.inf)
    few = straight[:: max(1, height // _SAMPLES), :: max(1, width // _SAMPLES)].reshape(-1, 2)
    few = np.concatenate([few, straight[-1], straight[:, -1]])
    finer = max(1.0, _magnification(camera, few[np.isfinite(few).all(axis=-1)]))
    shape = np.ceil((high - low) * finer).astype(np.int64) + 1 + 2 * _MARGIN
    if shape.prod() > _MAX_PIXEL_RATIO * width * height or shape.max() > _LONGEST_SIDE:
        return (
            f"its lens, distortion {distortion.tolist()}, distorts so much that the undistorted picture would have "
            f"{shape[0]} x {shape[1]} pixels for {width} x {height}: use smaller terms (cameras.distortion) or a "
            "longer focal length (a smaller cameras.fov)"
        )
    enlarged = np.diag([finer, finer, 1.0]) @ K
    enlarged[:2, 2] += _MARGIN - finer * low
    columns, rows = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    nearest = np.empty((height, width), np.int32)
    for band in bands:
        inside = imaged[band][..., None]
        places = np.where(inside, (straight[band] - low) * finer + _MARGIN, -100.0)
        column, row = np.moveaxis(np.where(inside, np.floor(places + 0.5), 0).astype(np.intp), -1, 0)
        columns[band], rows[band] = places[..., 0], places[..., 1]
        nearest[band] = row * int(shape[0]) + column
    return Lens(
        K=enlarged,
        size=(int(shape[0]), int(shape[1])),
        columns=columns,
        rows=rows,
        nearest=nearest,
        dark=None if imaged.all() else ~imaged,
    )


def _magnification(camera: Camera, straight: NDArray[np.float64]) -> float:
    """Return the largest magnification of a lens: the largest singular value of its derivative.

    Args:
        camera: camera with the lens; only K and distortion are used.
        straight: positions in the picture of the pinhole camera with the same K, (n, 2).
    """
    step = 1e-3  # pixels

    def bent(pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        directions = np.concatenate([pixels, np.ones((len(pixels), 1))], axis=1) @ np.linalg.inv(camera.K).T
        return project_to_image(camera, directions)

    a, c = ((bent(straight + [step, 0.0]) - bent(straight - [step, 0.0])) / (2 * step)).T
    b, d = ((bent(straight + [0.0, step]) - bent(straight - [0.0, step])) / (2 * step)).T
    squares, determinant = a * a + b * b + c * c + d * d, a * d - b * c
    largest = (squares + np.sqrt(np.maximum(squares**2 - 4 * determinant**2, 0.0))) / 2
    return float(np.sqrt(np.nanmax(largest)))  # NaN where the step leads over the fold
