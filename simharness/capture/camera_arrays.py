"""Parameters of several cameras as arrays, for kernels that project to all of them at once."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.camera import Camera
from mvpose.kernels import njit
from simharness.capture.body_outlines import packed
from simharness.world.rigs.projection import bend, is_imaged, projection_matrix


@dataclass(frozen=True)
class CameraArrays:
    """Parameters of V cameras.

    Attributes:
        cameras: the cameras.
        centers: their centres in the world, (V, 3), metres.
        axes: directions of their optical axes, (V, 3).
        projections: ``K [R | t]``, (V, 3, 4).
        table: all parameters, (V, 26), see :func:`~simharness.capture.body_outlines.packed`.
    """

    cameras: tuple[Camera, ...]
    centers: Floats
    axes: Floats
    projections: Floats
    table: Floats

    @classmethod
    def of(cls, cameras: Sequence[Camera], last: CameraArrays | None = None) -> CameraArrays:
        """Return the parameters of cameras, or ``last`` if it holds these same objects: a rig that stands still."""
        if last is not None and len(cameras) == len(last.cameras) and all(map(operator.is_, cameras, last.cameras)):
            return last
        views = len(cameras)
        return cls(
            tuple(cameras),
            np.array([camera.center for camera in cameras]).reshape(views, 3),
            np.array([camera.R[2] for camera in cameras]).reshape(views, 3),
            np.array([projection_matrix(camera) for camera in cameras]).reshape(views, 3, 4),
            np.array([packed(camera) for camera in cameras]).reshape(views, 26),
        )

    def pixels_of(self, points: Floats) -> tuple[Floats, Bools]:
        """Project points in the world, (V, ..., 3) or the same for all views, (1, ..., 3).

        Returns:
            Pixels, (V, ..., 2), to the bit those of :func:`~simharness.world.rigs.projection.project_to_image`; and
            whether they are inside the pictures, (V, ...).
        """
        views, shape = len(self.cameras), points.shape[1:-1]
        count = int(np.prod(shape))
        pixels, inside = np.empty((views, count, 2)), np.empty((views, count), bool)
        flat = np.ascontiguousarray(points, float).reshape(len(points), count, 3)
        _project(flat, self.projections, self.table, pixels, inside)
        return pixels.reshape(views, *shape, 2), inside.reshape(views, *shape)


@njit(cache=True)
def _project(points, projections, table, pixels, inside):
    """Write pixels (V, n, 2) of points (V, n, 3) or (1, n, 3), and whether they are inside the pictures, (V, n)."""
    for view in range(len(pixels)):
        at, c = points[min(view, len(points) - 1)], table[view]
        bent, lens = c[25] != 0.0, c[17:22]
        matrix = projections[view].copy()
        if bent:
            for i in range(3):
                for j in range(3):
                    matrix[i, j] = c[5 + 3 * i + j]
                matrix[i, 3] = c[14 + i]
        for i in range(pixels.shape[1]):
            x, y, z = at[i, 0], at[i, 1], at[i, 2]
            depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
            u, v = np.nan, np.nan
            if depth > 0.0:
                u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) / depth
                v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) / depth
            if bent and depth > 0.0:
                if is_imaged(u, v, lens, c[24]):
                    u, v = bend(u, v, lens)
                    u, v = c[0] * u + c[1] * v + c[2], c[3] * v + c[4]
                else:
                    u, v = np.nan, np.nan
            pixels[view, i, 0], pixels[view, i, 1] = u, v
            inside[view, i] = -0.5 <= u < c[22] - 0.5 and -0.5 <= v < c[23] - 0.5
