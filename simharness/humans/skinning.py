"""Linear blend skinning."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, fastmath=True)
def skin(
    vertices: NDArray[np.float32],
    bones: NDArray[np.uint8],
    weights: NDArray[np.float32],
    transforms: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Move ``vertices`` (n, 3) by the ``weights`` (n, w) of the ``transforms`` (B, 3, 4) of ``bones`` (n, w)."""
    blend = np.empty((3, 4), np.float32)
    for i in range(vertices.shape[0]):
        blend[:] = 0.0
        for k in range(bones.shape[1]):
            weight = weights[i, k]
            if weight > 0.0:
                transform = transforms[bones[i, k]]
                for row in range(3):
                    for column in range(4):
                        blend[row, column] += weight * transform[row, column]
        x, y, z = vertices[i]
        for row in range(3):
            out[i, row] = blend[row, 0] * x + blend[row, 1] * y + blend[row, 2] * z + blend[row, 3]
