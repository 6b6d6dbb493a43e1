"""Lines of sight from cameras to joints: occlusion by solids, and share of the pictures that solids fill."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Bools, Floats
from mvpose.camera import Camera, Rig
from mvpose.kernels import njit
from simharness.types.mesh import Mesh
from simharness.world.rigs.projection import project_to_image, viewing_rays
from simharness.world.scene.objects.solids import Solid

_COLUMNS, _ROWS = 20, 15  # grid of rays that samples a picture
_FAR = 100.0  # metres: length of these rays


def intersects(mesh: Mesh, starts: ArrayLike, ends: ArrayLike) -> Bools:
    """Return whether the lines from ``starts`` (n, 3) to ``ends`` (n, 3) intersect a mesh, (n,)."""
    starts, ends = np.ascontiguousarray(starts, float), np.ascontiguousarray(ends, float)
    result = np.zeros(len(starts), bool)
    if len(mesh.faces) and len(starts):
        _intersect(starts, ends, mesh.vertices[mesh.faces].astype(float), result)
    return result


@njit(cache=True, error_model="numpy")
def _intersect(starts, ends, triangles, result):
    """Intersect by Möller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997, after a box test."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for t in range(len(triangles)):
        for i in range(3):
            for c in range(3):
                low[c] = min(low[c], triangles[t, i, c])
                high[c] = max(high[c], triangles[t, i, c])
    for n in range(len(starts)):
        sx, sy, sz = starts[n, 0], starts[n, 1], starts[n, 2]
        dx, dy, dz = ends[n, 0] - sx, ends[n, 1] - sy, ends[n, 2] - sz
        first, last = 0.0, 1.0
        for c in range(3):
            step = ends[n, c] - starts[n, c]
            if abs(step) < 1e-12:
                if starts[n, c] < low[c] or starts[n, c] > high[c]:
                    last = -1.0
            else:
                one, two = (low[c] - starts[n, c]) / step, (high[c] - starts[n, c]) / step
                first, last = max(first, min(one, two)), min(last, max(one, two))
        if first > last:
            continue
        for t in range(len(triangles)):
            ax, ay, az = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
            ux, uy, uz = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay, triangles[t, 1, 2] - az
            vx, vy, vz = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay, triangles[t, 2, 2] - az
            px, py, pz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
            determinant = ux * px + uy * py + uz * pz
            if determinant == 0.0:
                continue
            wx, wy, wz = sx - ax, sy - ay, sz - az
            u = (wx * px + wy * py + wz * pz) / determinant
            if u < 0.0 or u > 1.0:
                continue
            qx, qy, qz = wy * uz - wz * uy, wz * ux - wx * uz, wx * uy - wy * ux
            v = (dx * qx + dy * qy + dz * qz) / determinant
            if v < 0.0 or u + v > 1.0:
                continue
            share = (vx * qx + vy * qy + vz * qz) / determinant
            if 0.0 <= share <= 1.0:
                result[n] = True
                break


@dataclass(frozen=True)
class SightLines:
    """Lines of sight from cameras to joints.

    Attributes:
        starts, ends: end points, (n, 3), metres.
        time: time at which the joint is at the end point, (n,), seconds.
    """

    starts: Floats
    ends: Floats
    time: Floats

    def __len__(self) -> int:
        return len(self.starts)

    def cut_by(self, solid: Solid) -> Bools:
        """Return whether a solid, at its positions at their times, cuts the lines, (n,)."""
        if solid.trajectory is None:
            return intersects(solid.mesh, self.starts, self.ends)
        pose = solid.trajectory.at(self.time)
        return intersects(solid.mesh, _into(pose, self.starts), _into(pose, self.ends))

    def hidden(self, solids: Iterable[Solid]) -> Bools:
        """Return whether any of the solids cuts the lines, (n,)."""
        result = np.zeros(len(self), bool)
        for solid in solids:
            result |= self.cut_by(solid)
        return result


def lines_of_sight(rig: Rig, time: Floats, joints: Floats) -> SightLines:
    """Return the lines from every camera to every joint inside its image.

    Args:
        rig: cameras.
        time: times, (N,), seconds.
        joints: positions of the joints, (N, P, J, 3), metres.
    """
    points = joints.reshape(-1, 3)
    when = np.repeat(time, joints.shape[1] * joints.shape[2])
    on_image = [camera.inside(project_to_image(camera, points)) for camera in rig]
    return SightLines(
        np.concatenate([np.tile(camera.center, (seen.sum(), 1)) for camera, seen in zip(rig, on_image, strict=True)]),
        np.concatenate([points[seen] for seen in on_image]),
        np.concatenate([when[seen] for seen in on_image]),
    )


class PictureFill:
    """Share of each picture that solids fill.

    Attributes:
        filled: whether each ray that samples a picture hits a solid, (V, n).
    """

    def __init__(self, rig: Rig) -> None:
        self._rays = [_grid(camera) for camera in rig]
        self.filled = np.zeros((len(rig), _COLUMNS * _ROWS), bool)

    def add(self, solid: Solid) -> None:
        """Add a solid."""
        self.filled |= self._hit_by(solid)

    def allows(self, solid: Solid, most: float) -> bool:
        """Return whether one more solid leaves every picture filled up to a share of ``most``, or unchanged."""
        more = self.filled | self._hit_by(solid)
        return bool((more.mean(axis=1) <= np.maximum(most, self.filled.mean(axis=1))).all())

    def _hit_by(self, solid: Solid) -> Bools:
        return np.reshape([intersects(solid.mesh, starts, ends) for starts, ends in self._rays], self.filled.shape)


def _grid(camera: Camera) -> tuple[Floats, Floats]:
    """Return starts and ends of rays through points spread evenly over the picture."""
    width, height = camera.size
    u, v = np.meshgrid((np.arange(_COLUMNS) + 0.5) / _COLUMNS, (np.arange(_ROWS) + 0.5) / _ROWS)
    rays = viewing_rays(camera, np.column_stack([u.ravel() * width, v.ravel() * height]) - 0.5)
    rays = np.where(np.isfinite(rays), rays, 0.0)  # not imaged by the lens: a line of length 0, which hits nothing
    starts = np.tile(camera.center, (len(rays), 1))
    return starts, starts + _FAR * rays


def _into(pose: Floats, points: Floats) -> Floats:
    """Return world points (n, 3) in the frames of poses (n, 7)."""
    w, x, y, z = pose[:, 3], -pose[:, 4], -pose[:, 5], -pose[:, 6]
    vector = np.column_stack([x, y, z])
    local = points - pose[:, :3]
    cross = np.cross(vector, local)
    return np.asarray(local + 2 * (w[:, None] * cross + np.cross(vector, cross)))
