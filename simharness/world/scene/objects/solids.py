"""Objects and solids of a scene, each with a mesh for pictures and geoms for rays and contacts."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.motion.motion import Trajectory, transform_points
from simharness.world.scene.objects.geoms import Box, Geom, carried

Kind = Literal["room", "furniture", "clutter", "prop", "decoy"]


@dataclass(frozen=True)
class ObjectModel:
    """Model of an object before it is placed: it stands on z = 0 around the origin, its front towards +x."""

    mesh: Mesh
    """Mesh for pictures."""
    geoms: tuple[Geom, ...]
    """Geoms for rays and contacts."""
    figure: Floats | None = None
    """COCO-17 joints, (17, 3), metres, if a detector may take the object for a person."""
    mirror: Mirror | None = None
    """Glass, if the object is a mirror."""

    @cached_property
    def extent(self) -> Box:
        """Bounding box."""
        return Box.around(self.mesh.vertices)

    def hull(self, place: ArrayLike, yaw: float) -> Box:
        """Return the bounding box of the object at ``place`` (2,), rotated by ``yaw``."""
        return self.extent.moved(place, yaw)

    def at(self, place: ArrayLike, yaw: float, *, kind: Kind, name: str) -> "Solid":
        """Return the solid at ``place`` (2,), rotated by ``yaw``."""
        figure = None if self.figure is None else carried(self.figure, place, yaw)
        mirror = None if self.mirror is None else self.mirror.moved(place, yaw)
        mesh = self.mesh.moved(carried(self.mesh.vertices, place, yaw))
        geoms = tuple(geom.moved(place, yaw) for geom in self.geoms)
        return Solid(kind, name, mesh, geoms, self.hull(place, yaw), figure=figure, mirror=mirror)

    def along(self, trajectory: Trajectory, *, kind: Kind, name: str) -> "Solid":
        """Return the solid that moves along a trajectory."""
        corners = np.concatenate([transform_points(self.extent.corners, pose) for pose in trajectory.pose])
        return Solid(kind, name, self.mesh, self.geoms, Box.around(corners), trajectory=trajectory)


@dataclass(frozen=True)
class Solid:
    """Solid object in the scene, at rest or moving."""

    kind: Kind
    """"room" (floor, walls), "furniture" (of a kind of room), "clutter", "prop" (used by people) or "decoy" (may be
    taken for a person)."""
    name: str
    """Name in messages and in the MuJoCo model."""
    mesh: Mesh
    """Mesh for pictures, in the world; in the frame of the trajectory if the solid moves. It is ``still`` if the solid
    does not move."""
    geoms: tuple[Geom, ...]
    """Geoms for rays and contacts, in the same frame as the mesh."""
    hull: Box
    """Bounding box in the world, over the whole trajectory of a moving solid; it includes empty space, such as that
    between the boards of a shelf."""
    trajectory: Trajectory | None = None
    """Poses of the frame of a moving solid; None at rest."""
    figure: Floats | None = None
    """COCO-17 joints in the world, (17, 3), metres, that a detector may find on a decoy."""
    mirror: Mirror | None = None
    """Glass of a mirror, in the world."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "mesh", replace(self.mesh, still=self.trajectory is None))

    def hull_at(self, time: float) -> Box:
        """Return the bounding box in the world at one time in seconds; axis-aligned if the solid is tilted."""
        if self.trajectory is None:
            return self.hull
        pose = self.trajectory.at(time)
        if np.abs(pose[4:6]).max() < 1e-6:  # upright
            return self._extent.moved(pose[:2], yaw_of(pose)).raised(pose[2])
        return Box.around(transform_points(self._extent.corners, pose))

    @cached_property
    def _extent(self) -> Box:
        return Box.around(self.mesh.vertices)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add the solid to a MuJoCo model.

        Geoms of a solid at rest belong to the world body; a moving solid is a mocap body of its name. A single geom has
        the name of the solid, several have a number appended: "box0 0", "box0 1".
        """
        body = spec.worldbody if self.trajectory is None else spec.worldbody.add_body(name=self.name, mocap=True)
        for k, geom in enumerate(self.geoms):
            geom.add_to(spec, body, self.name if len(self.geoms) == 1 else f"{self.name} {k}")


def yaw_of(pose: Floats) -> float:
    """Return the rotation about the vertical of a pose (7,), radians: place and quaternion of an upright solid."""
    return float(2 * np.arctan2(pose[6], pose[3]))
