"""Crops: boxes of images, resampled to the input size of a network.

A crop is axis-aligned in its image: the centre of its pixel (u, v) is the image pixel ``origin + stride * (u, v)``, as
in :class:`mvpose.heatmaps.Heatmaps`. A negative stride mirrors the crop.

OpenCV is not used because mvpose does not depend on it, and because ``warpAffine`` interpolates between four pixels
at any reduction, so that small crops of large boxes alias and flicker as the box moves.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mvpose.arrays import Bools, Floats, Integers
from mvpose.kernels import njit

Pixels = NDArray[np.uint8]
Images = Sequence[NDArray[np.uint8] | None]


class Placement(NamedTuple):
    """Position of m crops in their images."""

    origin: Floats
    """Image pixel of the centre of crop pixel (0, 0), x and y, (m, 2)."""
    stride: Floats
    """Image pixels between neighbouring crop pixels, x and y, (m, 2)."""

    def select(self, rows: Bools) -> "Placement":
        """Return the placement of some of the crops, given by a mask (m,)."""
        return Placement(self.origin[rows], self.stride[rows])

    def mirrored(self, middle: float) -> "Placement":
        """Return the crops mirrored left-right: pixel u becomes pixel ``2 * middle - u``."""
        origin, stride = self.origin.copy(), self.stride.copy()
        origin[:, 0] += 2.0 * middle * stride[:, 0]
        stride[:, 0] *= -1.0
        return Placement(origin, stride)


def stretched(boxes: Floats, size: tuple[int, int]) -> Placement:
    """Place boxes, (m, 4), stretched to width and height regardless of aspect, the convention of re-ID networks.

    The edges of the box are the outer edges of the first and last pixels of the crop.
    """
    with np.errstate(over="ignore"):  # a box that overflows is never in view
        stride = boxes[:, 2:] / np.array(size)
        return Placement(boxes[:, :2] + 0.5 * stride, stride)


def padded(boxes: Floats, size: tuple[int, int], padding: float) -> Placement:
    """Place boxes, (m, 4), enlarged by ``padding`` around their centres and extended to the aspect of the crop."""
    with np.errstate(over="ignore", invalid="ignore"):  # as above
        extent = padding * boxes[:, 2:] / np.array(size)
        stride = np.repeat(extent.max(axis=1, keepdims=True), 2, axis=1)
        middle = boxes[:, :2] + 0.5 * boxes[:, 2:]
        return Placement(middle - stride * (np.array(size) - 1) / 2.0, stride)


def in_view(
    images: Images, view: Integers, placement: Placement, size: tuple[int, int], *, least: float = 0.0
) -> Bools:
    """Return a mask of the crops that show part of the image of their view, (m,).

    These are the crops with an area, of which at least one pixel and at least a fraction ``least`` of the pixels have
    their centres inside the image. The other crops consist mostly of the fill colour and look alike for every person.
    No crop of a view whose image is None is in view.

    Args:
        images: image of each view, (h, w, 3) or None.
        view: view of each crop, (m,).
        placement: position of the crops in their images.
        size: width and height of the crops.
        least: least fraction of pixels inside the image, 0 to 1.
    """
    sizes = np.array([(0, 0) if image is None else (image.shape[1], image.shape[0]) for image in images], float)
    extent = sizes.reshape(-1, 2)[view]
    share = np.ones(len(view))
    for axis, count in enumerate(size):
        with np.errstate(over="ignore", invalid="ignore"):  # as above
            centre = placement.origin[:, axis, None] + placement.stride[:, axis, None] * np.arange(count)
        share *= ((centre >= -0.5) & (centre < extent[:, axis, None] - 0.5)).mean(axis=1)  # as in _taps
    return np.all(placement.stride > 0, axis=1) & (share > 0) & (share >= least)


def check_images(images: Images, view: Integers, boxes: Floats) -> None:
    """Check that images holds a picture or None for every view of a box, and that boxes are finite.

    Raises:
        ValueError: a view beyond the list of images, an image that is not (h, w, 3) uint8, a box that is not finite.
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


def crop_images(
    images: Images, view: Integers, placement: Placement, size: tuple[int, int], *, fill: tuple[int, int, int]
) -> Pixels:
    """Cut crops out of images, (m, height, width, 3), red green blue.

    Where a crop reduces its box, each pixel is a mean over all the image pixels that it covers, weighted by a triangle
    two crop pixels wide (the antialiased bilinear resizing of Pillow and torchvision). No image pixel is skipped, so a
    crop changes smoothly with its box. Where a crop enlarges its box, this is bilinear interpolation. A crop pixel
    whose centre is outside the image has the colour ``fill``; one inside is a mean of pixels inside.

    Args:
        images: image of each view, (h, w, 3), checked by :func:`check_images`; not None for the views of crops.
        view: view of each crop, (m,).
        placement: position of the crops in their images.
        size: width and height of the crops.
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
    """Return, for every crop pixel along one axis, its first image pixel, their number, and their weights.

    The number is 0 where the centre is outside the image.
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
    """Write one crop, (H, W, 3), of an image, (h, 3 w), by separable resampling, rows first."""
    height, width = crop.shape[:2]
    top, tall, down = _taps(origin[1], stride[1], height, image.shape[0])
    left, wide, across = _taps(origin[0], stride[0], width, image.shape[1] // 3)
    start, end = image.shape[1], 0  # range of the columns needed
    for u in range(width):
        if wide[u]:
            start, end = min(start, 3 * left[u]), max(end, 3 * (left[u] + wide[u]))
    line = np.zeros(max(end - start, 0), np.float32)
    for v in range(height):
        line[:] = 0.5  # so that the conversion to integers rounds
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
