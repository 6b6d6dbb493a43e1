"""What things are made of, for rays and contacts: boxes, cylinders and surfaces, each a geom of MuJoCo's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mvpose.arrays import Floats

if TYPE_CHECKING:
    import mujoco

Point = tuple[float, float, float]

_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


class Geom(Protocol):
    """A part of a thing."""

    def moved(self, place: ArrayLike, yaw: float) -> Self:
        """The same turned about the world's z axis and then carried to ``place`` (2,) on the floor."""
        ...

    def add_to(self, spec: mujoco.MjSpec, body: Any, name: str) -> None:
        """Add it to a body of a MuJoCo model, under a name that is unique there."""
        ...


@dataclass(frozen=True)
class Box:
    """A cuboid that stands upright, turned about the vertical.

    Attributes:
        center: metres, (3,).
        half: half its sides along its own axes, metres, (3,).
        yaw: its turn about z, radians.
    """

    center: Point
    half: Point
    yaw: float = 0.0

    @cached_property
    def axes(self) -> Floats:
        """Its own axes as columns, (3, 3)."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    @cached_property
    def corners(self) -> Floats:
        """The eight corners, (8, 3) metres; x changes slowest and z fastest, low before high."""
        return np.array(self.center) + (_SIGNS * self.half) @ self.axes.T

    @classmethod
    def around(cls, points: ArrayLike) -> Box:
        """The smallest box along the axes that holds points (n, 3)."""
        points = np.asarray(points, float)
        low, high = points.min(axis=0), points.max(axis=0)
        return cls(_point((low + high) / 2), _point((high - low) / 2))

    def distance(self, points: ArrayLike) -> Floats:
        """Distance of points (..., 3) to the box, (...) metres; 0 inside."""
        return np.linalg.norm(self._outside(points), axis=-1)

    def distance_on_floor(self, points: ArrayLike) -> Floats:
        """Horizontal distance of points (..., 3) to the box's ground plan, (...) metres; 0 over it."""
        return np.linalg.norm(self._outside(points)[..., :2], axis=-1)

    def _outside(self, points: ArrayLike) -> Floats:
        local = (np.asarray(points, float) - self.center) @ self.axes
        return np.maximum(np.abs(local) - self.half, 0.0)

    def gap_on_floor(self, other: Box) -> float:
        """Horizontal distance between two boxes' ground plans by separating axes, metres; 0 where they overlap.

        Corner to corner the true distance is larger; never smaller.
        """
        away = (other.center[0] - self.center[0], other.center[1] - self.center[1])
        c, s = abs(math.cos(other.yaw - self.yaw)), abs(math.sin(other.yaw - self.yaw))
        best = 0.0
        for one, two in ((self, other), (other, self)):
            cos, sin = math.cos(one.yaw), math.sin(one.yaw)
            (x, y, _), (u, v, _) = one.half, two.half
            along = abs(cos * away[0] + sin * away[1]) - x - (c * u + s * v)
            across = abs(cos * away[1] - sin * away[0]) - y - (s * u + c * v)
            best = max(best, along, across)
        return best

    def moved(self, place: ArrayLike, yaw: float) -> Box:
        """See :class:`Geom`."""
        return Box(_carried(self.center, place, yaw), self.half, self.yaw + yaw)

    def raised(self, height: float) -> Box:
        """The box carried up by ``height`` metres."""
        x, y, z = self.center
        return Box((x, y, float(z + height)), self.half, self.yaw)

    def add_to(self, spec: mujoco.MjSpec, body: Any, name: str) -> None:
        """See :class:`Geom`."""
        import mujoco

        quat = [np.cos(self.yaw / 2), 0.0, 0.0, np.sin(self.yaw / 2)]
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, pos=self.center, size=self.half, quat=quat)


@dataclass(frozen=True)
class Cylinder:
    """A round bar or disc.

    Attributes:
        center: metres, (3,).
        radius, half: its radius and half its length, metres.
        axis: unit vector along it, (3,).
    """

    center: Point
    radius: float
    half: float
    axis: Point = (0.0, 0.0, 1.0)

    def moved(self, place: ArrayLike, yaw: float) -> Cylinder:
        """See :class:`Geom`."""
        axis = _carried(self.axis, (0.0, 0.0), yaw)
        return Cylinder(_carried(self.center, place, yaw), self.radius, self.half, axis)

    def add_to(self, spec: mujoco.MjSpec, body: Any, name: str) -> None:
        """See :class:`Geom`."""
        import mujoco

        quat = np.empty(4)
        mujoco.mju_quatZ2Vec(quat, np.array(self.axis))
        size = [self.radius, self.half, 0.0]
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_CYLINDER, pos=self.center, size=size, quat=quat)


@dataclass(frozen=True)
class Surface:
    """Triangles as they are: rays meet every one of them, contacts their convex hull.

    Attributes:
        vertices: metres, (n, 3).
        faces: vertex indices, (k, 3).
    """

    vertices: Floats
    faces: NDArray[np.int32]

    def moved(self, place: ArrayLike, yaw: float) -> Surface:
        """See :class:`Geom`."""
        return Surface(carried(self.vertices, place, yaw), self.faces)

    def add_to(self, spec: mujoco.MjSpec, body: Any, name: str) -> None:
        """See :class:`Geom`; the mesh that it needs takes its name."""
        import mujoco

        spec.add_mesh(
            name=name,
            uservert=self.vertices.ravel(),
            userface=np.asarray(self.faces, np.int32).ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,  # a surface may be open; nothing here is weighed
        )
        body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name)


def carried(points: ArrayLike, place: ArrayLike, yaw: float) -> Floats:
    """Points (..., 3) turned about the world's z axis and then carried to ``place`` (2,) on the floor."""
    c, s = np.cos(yaw), np.sin(yaw)
    turned = np.asarray(points, float) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return turned + np.append(np.asarray(place, float), 0.0)


def _carried(point: Point, place: ArrayLike, yaw: float) -> Point:
    return _point(carried(point, place, yaw))


def _point(values: Floats) -> Point:
    x, y, z = values.tolist()
    return x, y, z
