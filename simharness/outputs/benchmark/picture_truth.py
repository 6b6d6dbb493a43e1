"""Truth in the pictures as arrays: how each joint is seen, and heat maps that networks are trained towards."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mvpose.skeleton import COCO17
from simharness.outputs.benchmark.layout import Layout
from simharness.types.truth import Truth
from simharness.types.views import Visibility

VISIBILITY, HEATMAPS = "visibility", "heatmaps"
"""Names of these files among what is written beside the pictures."""

STRIDE = 4
"""Pixels between the cells of a heat map, as of networks with maps of a quarter of their input (Xiao, Wu & Wei, "Simple
baselines", ECCV 2018)."""

WIDTH = 2.0
"""Standard deviation of a peak, cells (the same paper)."""


def write_visibility(layout: Layout, cameras: Sequence[str], truth: Mapping[int, Truth], people: Sequence[int]) -> None:
    """Write ``visibility.npz``: how each joint of each person is seen in each picture, and where.

    It has ``frames`` (F,), ``cameras`` (V,), ``people`` (P,), ``joints`` (17,) and ``states``, names of the values of
    ``visibility`` (F, V, P, 17); ``pixels`` (F, V, P, 17, 2), NaN behind a camera; and ``boxes`` (F, V, P, 4), x, y,
    width, height. Integers are the centres of pixels.

    Args:
        layout: paths of the sequence.
        cameras: names of the cameras in the files.
        truth: truth by frame.
        people: identities of the people in the truth.
    """
    np.savez_compressed(
        layout.folder / f"{VISIBILITY}.npz",
        allow_pickle=False,
        frames=list(truth),
        cameras=list(cameras),
        people=list(people),
        joints=COCO17.joints,
        states=[state.name.lower() for state in Visibility],
        **{key: np.stack([getattr(each, key) for each in truth.values()]) for key in ("visibility", "pixels", "boxes")},
    )


def write_heatmaps(path: Path, true: Truth, view: int, size: tuple[int, int]) -> None:
    """Write the heat maps of a picture: ``values`` (17, h, w), 255 at a peak, ``origin`` and ``stride``.

    The centre of cell (row, column) is the pixel ``origin + stride * (column, row)``.

    Args:
        path: the file, .npz; its folder is made where it is missing.
        true: truth of the frame.
        view: the camera.
        size: width and height of its pictures, pixels.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    seen = true.visibility[view] != Visibility.OUTSIDE
    values = heatmaps(np.where(seen[..., None], true.pixels[view], np.nan), size)
    place = np.full(2, (STRIDE - 1) / 2)
    np.savez_compressed(path, allow_pickle=False, values=values, origin=place, stride=np.full(2, STRIDE))


def heatmaps(pixels: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the heat map of each joint, (J, h, w): the highest of the Gaussians about that joint of all people.

    Args:
        pixels: joints of the people, (P, J, 2); NaN of joints without a peak.
        size: width and height of the picture, pixels.
    """
    columns, rows = (-(-pixel // STRIDE) for pixel in size)
    cells = np.nan_to_num((pixels - (STRIDE - 1) / 2) / STRIDE, nan=-np.inf)
    along, down = (
        np.exp(-0.5 * ((np.arange(count) - cells[..., axis, None]) / WIDTH) ** 2).astype(np.float32)
        for axis, count in enumerate((columns, rows))
    )
    highest = np.zeros((pixels.shape[1], rows, columns), np.float32)
    for across, below in zip(along, down, strict=True):
        np.maximum(highest, below[:, :, None] * across[:, None, :], out=highest)
    return np.rint(255.0 * highest).astype(np.uint8)
