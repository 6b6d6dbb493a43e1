"""Crops: boxes of images, stretched to the input size of a network.

A crop lies in its image without rotation: the centre of its pixel (u, v) is the image pixel
``origin + stride * (u, v)``, as :class:`mvpose.heatmaps.Heatmaps` lie. A negative stride mirrors.

Written here and not taken from OpenCV: mvpose does without it, and its ``warpAffine`` takes four neighbours however
much it shrinks, so that what a distant network sees of a near person flickers with the box.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.arrays import Floats

Pixels = NDArray[np.uint8]
Images = Sequence[NDArray[np.uint8] | None]


class Placement(NamedTuple):
    """Where crops lie in their images: the pixel of the centre of crop pixel (0, 0), and pixels from one to the next.

    Both are x and y, (m, 2).
    """

    origin: Floats
    stride: Floats

    def of(self, rows: NDArray[np.bool_]) -> Placement:
        """Some of the crops."""
        return Placement(self.origin[rows], self.stride[rows])

    def mirrored(self, middle: float) -> Placement:
        """The same crops seen in a mirror: pixel u of each becomes pixel ``2 * middle - u``."""
        origin, stride = self.origin.copy(), self.stride.copy()
        origin[:, 0] += 2.0 * middle * stride[:, 0]
        stride[:, 0] *= -1.0
        return Placement(origin, stride)


def stretched(boxes: Floats, size: tuple[int, int]) -> Placement:
    """Boxes, (m, 4), stretched to width and height whatever their aspect: re-ID networks are trained so.

    The edges of the box are the outer edges of the crop's first and last pixels.
    """
    with np.errstate(over="ignore"):  # boxes beyond all numbers: none of their crop is in view
        stride = boxes[:, 2:] / np.array(size)
        return Placement(boxes[:, :2] + 0.5 * stride, stride)


def padded(boxes: Floats, size: tuple[int, int], padding: float) -> Placement:
    """Boxes, (m, 4), widened ``padding`` times about their middles and then, one way, to the crop's aspect."""
    with np.errstate(over="ignore", invalid="ignore"):  # as above
        extent = padding * boxes[:, 2:] / np.array(size)
        stride = np.repeat(extent.max(axis=1, keepdims=True), 2, axis=1)
        middle = boxes[:, :2] + 0.5 * boxes[:, 2:]
        return Placement(middle - stride * (np.array(size) - 1) / 2.0, stride)


def in_view(
    images: Images, view: NDArray[np.int64], placement: Placement, size: tuple[int, int], *, least: float = 0.0
) -> NDArray[np.bool_]:
    """Which crops show something of the image of their view, (m,).

    Those with an area, of whose pixels some, and at least a share ``least``, have their centres inside the image. The
    others are of the colour of the fill, all but that share, and look alike whoever is in the box. A view whose image
    is None has no picture: none of its crops is in view.

    Args:
        images: (h, w, 3) of each view.
        view: whose image each crop is of, (m,).
        placement: where in the image it lies.
        size: width and height of the crops.
        least: 0 to 1.
    """
    sizes = np.array([(0, 0) if image is None else (image.shape[1], image.shape[0]) for image in images], float)
    extent = sizes.reshape(-1, 2)[view]
    share = np.ones(len(view))
    for axis, count in enumerate(size):
        with np.errstate(over="ignore", invalid="ignore"):  # as above
            centre = placement.origin[:, axis, None] + placement.stride[:, axis, None] * np.arange(count)
        share *= ((centre >= -0.5) & (centre < extent[:, axis, None] - 0.5)).mean(axis=1)  # as in _taps
    return np.all(placement.stride > 0, axis=1) & (share > 0) & (share >= least)


def check_images(images: Images, view: NDArray[np.int64], boxes: Floats) -> None:
    """Refuse what is no list of pictures, a picture or None for every view that is named, and boxes that are none.

    Raises:
        ValueError: a view without an image, an image that is not (h, w, 3) uint8, a box that is not finite.
    """
    if not np.isfinite(boxes).all():
        bad = int(np.flatnonzero(~np.isfinite(boxes).all(axis=1))[0])
        raise ValueError(f"boxes must be finite x, y, width, height, got {boxes[bad].tolist()} for detection {bad}")
    if len(view) and view.min() < 0:
        raise ValueError(f"view must be camera indices from 0, got {view.min()}")
    if isinstance(images, np.ndarray) and images.ndim == 3:
        raise ValueError("images must be a sequence with a picture (h, w, 3) for each view, got one picture")
    if len(view) and view.max() >= len(images):
        raise ValueError(
            f"images must hold a picture for every view, got {len(images)} pictures and a detection of view "
            f"{view.max()}; give None for a view without a picture"
        )
    for index, image in enumerate(images):
        if image is None:
            continue
        if not (isinstance(image, np.ndarray) and image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] == 3):
            got = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
            raise ValueError(f"image of view {index} must be (h, w, 3) uint8, red green blue, got {got}")


def cut(
    images: Images, view: NDArray[np.int64], placement: Placement, size: tuple[int, int], *, fill: tuple[int, int, int]
) -> Pixels:
    """Crops of a width and a height, (m, height, width, 3), red green blue.

    Where a crop shrinks its box, each pixel is a mean of all it covers, weighted by a triangle two of the crop's
    pixels wide (as Pillow's and torchvision's antialiased bilinear resizing): nothing of the image is skipped, so a
    crop changes smoothly with its box. Where it enlarges, this is bilinear interpolation. A pixel whose centre is
    outside the image is of the colour ``fill``; one inside is a mean of pixels inside.

    Args:
        images: (h, w, 3) of each view, checked by :func:`check_images`, and a picture in each view that is named.
        view: whose image each crop is of, (m,).
        placement: where in the image it lies.
        size: width and height.
        fill: red, green and blue outside the image.
    """
    width, height = size
    crops = np.empty((len(view), height, width, 3), np.uint8)
    colour = np.array(fill, np.uint8)
    rows = {k: np.ascontiguousarray(images[k]).reshape(len(images[k]), -1) for k in np.unique(view)}
    for i, k in enumerate(view):
        _cut(rows[k], placement.origin[i], placement.stride[i], colour, crops[i])
    return crops


@njit(cache=True)
def _taps(origin, stride, count, length):
    """For every pixel of a crop, along one axis: its first pixel of the image, how many, and their weights.

    None where the centre is outside.
    """
    reach = max(1.0, abs(stride))
    first, many = np.zeros(count, np.int64), np.zeros(count, np.int64)
    weights = np.zeros((count, int(min(2.0 * reach + 2.0, length))), np.float32)
    for u in range(count):
        centre = origin + stride * u
        if not -0.5 <= centre < length - 0.5:
            continue
        low = int(max(math.ceil(centre - reach), 0.0))
        high = int(min(math.floor(centre + reach), length - 1.0))
        total = 0.0
        for k in range(low, high + 1):
            total += reach - abs(k - centre)
        for k in range(low, high + 1):
            weights[u, k - low] = (reach - abs(k - centre)) / total
        first[u], many[u] = low, high + 1 - low
    return first, many, weights


@njit(cache=True, fastmath={"reassoc", "contract"})
def _cut(image, origin, stride, fill, crop):
    """One crop, (H, W, 3), of an image, (h, 3 w): the axes are weighted one after the other, rows first."""
    height, width = crop.shape[:2]
    top, tall, down = _taps(origin[1], stride[1], height, image.shape[0])
    left, wide, across = _taps(origin[0], stride[0], width, image.shape[1] // 3)
    start, end = image.shape[1], 0  # of the columns that are needed
    for u in range(width):
        if wide[u]:
            start, end = min(start, 3 * left[u]), max(end, 3 * (left[u] + wide[u]))
    line = np.zeros(max(end - start, 0), np.float32)
    for v in range(height):
        line[:] = 0.5  # rounds the result
        for k in range(tall[v]):
            source, weight = image[top[v] + k, start:end], down[v, k]
            for c in range(len(line)):
                line[c] += weight * source[c]
        for u in range(width):
            if tall[v] == 0 or wide[u] == 0:
                crop[v, u, 0], crop[v, u, 1], crop[v, u, 2] = fill[0], fill[1], fill[2]
                continue
            red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            c = 3 * left[u] - start
            for k in range(wide[u]):
                weight = across[u, k]
                red += weight * line[c + 3 * k]
                green += weight * line[c + 3 * k + 1]
                blue += weight * line[c + 3 * k + 2]
            crop[v, u, 0], crop[v, u, 1], crop[v, u, 2] = np.uint8(red), np.uint8(green), np.uint8(blue)
