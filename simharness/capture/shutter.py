"""Rolling shutter: the rows of one picture are exposed one after the other.

The readout is divided into bands of rows, each rendered at its time; between these times joints are interpolated
linearly.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from mvpose.arrays import Floats
from mvpose.camera import Camera
from simharness.world.rigs.projection import project_to_image

BANDS = 8
_ITERATIONS = 6  # a joint moves a fraction of a band per iteration: this converges quickly


def band_times(time: float, readout: float) -> Floats:
    """Return the times at which the bands of a picture are exposed, (n,) seconds; one time if the readout is 0."""
    if readout == 0.0:
        return np.array([time])
    return time + readout * ((np.arange(BANDS) + 0.5) / BANDS - 0.5)


def joints_at_exposure(joints: Floats, camera: Camera) -> Floats:
    """Return the positions of joints at the time at which the row that shows them is exposed.

    Args:
        joints: positions in the world at the times of the bands, (n, P, J, 3), metres.
        camera: camera of the picture.

    Returns:
        Positions, (P, J, 3), metres; for a joint outside the picture the position in the middle of the readout.
    """
    count = len(joints)
    middle = (joints[(count - 1) // 2] + joints[count // 2]) / 2
    positions = middle
    for _ in range(_ITERATIONS if count > 1 else 0):
        row = project_to_image(camera, positions)[..., 1]
        band = np.clip((row + 0.5) / camera.size[1] * count - 0.5, 0, count - 1)
        low = np.minimum(np.nan_to_num(band).astype(int), count - 2)
        share = (band - low)[..., None]
        one, two = (np.take_along_axis(joints, k[None, ..., None], axis=0)[0] for k in (low, low + 1))
        positions = np.where(np.isfinite(share), (1 - share) * one + share * two, middle)
    return positions


def band_cameras(camera: Camera, count: int) -> list[Camera]:
    """Return cameras for ``count`` bands of rows from the top; their stacked pictures are the picture of ``camera``."""
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
