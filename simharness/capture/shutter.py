"""A rolling shutter: rows of one picture are taken one after the other, so it shows many moments at once.

The readout is cut into bands of rows, each with a state of the scene of its own; between the bands' moments joints move
in a straight line.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.capture.rendering.lens import project_to_image

BANDS = 8
_ITERATIONS = 6  # a joint moves a fraction of a band while its row is found: this converges at once


def moments(time: float, readout: float) -> Floats:
    """When the bands of a picture are taken, (n,) seconds; one moment alone where all rows are taken at once."""
    if readout == 0.0:
        return np.array([time])
    return time + readout * ((np.arange(BANDS) + 0.5) / BANDS - 0.5)


def rolled(joints: Floats, camera: Camera) -> Floats:
    """Where joints are when their own row is taken.

    Args:
        joints: in the world at the moments of the bands, (n, P, J, 3), metres.
        camera: takes the picture.

    Returns:
        (P, J, 3) metres; for a joint that is not in the picture its place in the middle of the readout.
    """
    count = len(joints)
    middle = (joints[(count - 1) // 2] + joints[count // 2]) / 2
    where = middle
    for _ in range(_ITERATIONS if count > 1 else 0):
        row = project_to_image(camera, where)[..., 1]
        band = np.clip((row + 0.5) / camera.size[1] * count - 0.5, 0, count - 1)
        low = np.minimum(np.nan_to_num(band).astype(int), count - 2)
        share = (band - low)[..., None]
        one, two = (np.take_along_axis(joints, k[None, ..., None], axis=0)[0] for k in (low, low + 1))
        where = np.where(np.isfinite(share), (1 - share) * one + share * two, middle)
    return where


def strips(camera: Camera, count: int) -> list[Camera]:
    """The camera cut into ``count`` bands of rows, from the top: pictures of them, one below the other, are its own."""
    if count == 1:
        return [camera]
    width, height = camera.size
    edges = np.ceil(np.arange(count + 1) * height / count - 0.5).astype(int)
    result = []
    for top, bottom in pairwise(edges.tolist()):
        K = camera.K.copy()
        K[1, 2] -= top
        result.append(replace(camera, K=K, size=(width, bottom - top)))
    return result
