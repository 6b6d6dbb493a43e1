"""Geoms of objects for rays and contacts: boxes and surfaces, each added to MuJoCo as one geom."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats
from simharness.types.floor import Floor

Point = tuple[float, float, float]

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


@dataclass(frozen=True)
class Box:
    """Upright cuboid, rotated about the vertical axis."""

    center: Point
    """Centre, (3,), metres."""
    half: Point
    """Half sides along the axes of the box, (3,), metres."""
    yaw: float = 0.0
    """Rotation about z, radians."""

    @cached_property
    def axes(self) -> Floats:
        """Axes of the box as columns, (3, 3)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @cached_property
    def corners(self) -> Floats:
        """The eight corners, (8, 3), metres; x changes slowest and z fastest, low before high."""
        return np.array(self.center) + (_SIGNS * self.half) @ self.axes.T

    @property
    def footprint(self) -> Floor:
        """Area of the floor under or over the box."""
        return Floor(self.corners[[0, 4, 6, 2], :2])

    @classmethod
    def around(cls, points: ArrayLike) -> "Box":
        """Return the axis-aligned bounding box of points (n, 3)."""
        points = np.asarray(points, float)
        low, high = points.min(axis=0), points.max(axis=0)
        return cls(_point((low + high) / 2), _point((high - low) / 2))

    def distance(self, points: ArrayLike) -> Floats:
        """Return the distance of points (..., 3) to the box, (...), metres; 0 inside."""
        return np.linalg.norm(self._outside(points), axis=-1)

    def distance_on_floor(self, points: ArrayLike) -> Floats:
        """Return the horizontal distance of points (..., 3) to the footprint of the box, (...), metres; 0 above it."""
        return np.linalg.norm(self._outside(points)[..., :2], axis=-1)

    def _outside(self, points: ArrayLike) -> Floats:
        local = (np.asarray(points, float) - self.center) @ self.axes
        return np.maximum(np.abs(local) - self.half, 0.0)

    def gap_on_floor(self, other: "Box") -> float:
        """Return the horizontal distance between the footprints of two boxes, metres; 0 if they overlap.

        It is computed by separating axes: a lower bound, exact except from corner to corner.
        """
        offset = (other.center[0] - self.center[0], other.center[1] - self.center[1])
        c, s = abs(math.cos(other.yaw - self.yaw)), abs(math.sin(other.yaw - self.yaw))
        best = 0.0
        for one, two in ((self, other), (other, self)):
            cos, sin = math.cos(one.yaw), math.sin(one.yaw)
            (x, y, _), (u, v, _) = one.half, two.half
            along = abs(cos * offset[0] + sin * offset[1]) - x - (c * u + s * v)
            across = abs(cos * offset[1] - sin * offset[0]) - y - (s * u + c * v)
            best = max(best, along, across)
        return best

    def moved(self, place: ArrayLike, yaw: float) -> "Box":
        """Return the geom rotated by ``yaw`` about the world z axis, then moved by ``place`` (2,) on the floor."""
        return Box(_point(carried(self.center, place, yaw)), self.half, self.yaw + yaw)

    def raised(self, height: float) -> "Box":
        """Return the box raised by ``height`` metres."""
        x, y, z = self.center
        return Box((x, y, float(z + height)), self.half, self.yaw)

    def add_to(self, spec: mujoco.MjSpec, body: Any, name: str) -> None:
        """Add the geom to a body of a MuJoCo model, under a name that is unique in the model."""
        quat = [np.cos(self.yaw / 2), 0.0, 0.0, np.sin(self.yaw / 2)]
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=self.center, size=self.half, quat=quat)


@dataclass(frozen=True)
class Surface:
    """Triangle mesh as a geom: rays test every triangle, contacts use the convex hull, if it ``touches`` anything."""

    vertices: Floats
    """Positions, (n, 3), metres."""
    faces: NDArray[np.int32]
    """Vertex indices, (k, 3)."""
    touches: bool = True

    def moved(self, place: ArrayLike, yaw: float) -> "Surface":
        """Return the geom rotated by ``yaw`` about the world z axis, then moved by ``place`` (2,) on the floor."""
        return replace(self, vertices=carried(self.vertices, place, yaw))

    def add_to(self, spec: mujoco.MjSpec, body: Any, name: str) -> None:
        """Add the geom to a body of a MuJoCo model, under a unique name, which the mesh asset gets as well."""
        spec.add_mesh(
            name=name,
            uservert=self.vertices.ravel(),
            userface=np.asarray(self.faces, np.int32).ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,  # a surface may be open; its mass is not used
        )
        touches = {} if self.touches else {"contype": 0, "conaffinity": 0}
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **touches)


Geom = Box | Surface


def carried(points: ArrayLike, place: ArrayLike, yaw: float) -> Floats:
    """Return points (..., 3) rotated by ``yaw`` about the world z axis, then moved by ``place`` (2,) on the floor."""
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.asarray(points, float) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned + np.append(np.asarray(place, float), 0.0)


def _point(values: Floats) -> Point:
    x, y, z = values.tolist()
    return x, y, z
