"""Things in the scene, each with its looks for pictures and its geoms for rays and contacts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.world.motion.trajectory import Trajectory, transform_points
from simharness.world.scene.objects.geoms import Box, Geom, carried

if TYPE_CHECKING:
    import mujoco

Kind = Literal["room", "clutter", "prop", "decoy"]


@dataclass(frozen=True)
class ObjectModel:
    """Something that has no place yet: it stands on z = 0 around the origin, its front towards +x.

    Attributes:
        mesh: how it looks.
        geoms: what it is made of.
        figure: COCO-17 joints (17, 3), metres, where a detector may take it for a person.
        mirror: its glass, where it is one.
    """

    mesh: Mesh
    geoms: tuple[Geom, ...]
    figure: Floats | None = None
    mirror: Mirror | None = None

    @cached_property
    def extent(self) -> Box:
        """The box around all of it."""
        return Box.around(self.mesh.vertices)

    def hull(self, place: ArrayLike, yaw: float) -> Box:
        """The box around all of it when it stands at ``place`` (2,) turned by ``yaw``."""
        return self.extent.moved(place, yaw)

    def at(self, place: ArrayLike, yaw: float, *, kind: Kind, name: str) -> Solid:
        """The thing at ``place`` (2,), turned by ``yaw``."""
        return Solid(
            kind,
            name,
            replace(self.mesh, vertices=carried(self.mesh.vertices, place, yaw).astype(np.float32)),
            tuple(geom.moved(place, yaw) for geom in self.geoms),
            self.hull(place, yaw),
            figure=None if self.figure is None else carried(self.figure, place, yaw),
            mirror=None if self.mirror is None else self.mirror.moved(place, yaw),
        )

    def along(self, trajectory: Trajectory, *, kind: Kind, name: str) -> Solid:
        """The thing on its way."""
        corners = np.concatenate([transform_points(self.extent.corners, pose) for pose in trajectory.pose])
        return Solid(kind, name, self.mesh, self.geoms, Box.around(corners), trajectory=trajectory)


@dataclass(frozen=True)
class Solid:
    """A thing in the room, at rest or moving.

    Attributes:
        kind: "room" (floor, walls), "clutter", "prop" (people use it) or "decoy" (may be taken for a person).
        name: what messages and the MuJoCo model call it.
        mesh: how it looks; in the world, of a moving thing in its own frame.
        geoms: what it is made of, in the same frame.
        hull: a box in the world around all of it, and of a moving thing around all of its way; the space between
            the boards of a shelf is inside.
        trajectory: where the frame of a moving thing is; None of one at rest.
        figure: COCO-17 joints (17, 3) in the world, metres, that a detector may find on a decoy.
        mirror: the glass of a mirror, in the world.
    """

    kind: Kind
    name: str
    mesh: Mesh
    geoms: tuple[Geom, ...]
    hull: Box
    trajectory: Trajectory | None = None
    figure: Floats | None = None
    mirror: Mirror | None = None

    def hull_at(self, time: float) -> Box:
        """A box in the world around all of it at one moment, seconds; of one that is tilted, along the world's axes."""
        if self.trajectory is None:
            return self.hull
        pose = self.trajectory.at(time)
        if np.abs(pose[4:6]).max() < 1e-6:  # upright
            return self._extent.moved(pose[:2], _yaw(pose)).raised(pose[2])
        return Box.around(transform_points(self._extent.corners, pose))

    @cached_property
    def _extent(self) -> Box:
        return Box.around(self.mesh.vertices)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Add it to a MuJoCo model.

        At rest its geoms belong to the world; a moving one is a mocap body of its name. A single geom has its name,
        several have a number after it: "box0 0", "box0 1".
        """
        body = spec.worldbody if self.trajectory is None else spec.worldbody.add_body(name=self.name, mocap=True)
        for k, geom in enumerate(self.geoms):
            geom.add_to(spec, body, self.name if len(self.geoms) == 1 else f"{self.name} {k}")


def _yaw(pose: Floats) -> float:
    return float(2 * np.arctan2(pose[6], pose[3]))
