"""A frame of a run seen from outside of the room: the things as a picture, and where people and cameras are in it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mvpose import Camera
from mvpose.arrays import Floats
from simharness.capture.picture import antialiased, meshes_at, scaled
from simharness.report.figures.turnable import pyramid
from simharness.report.run.pictures import Picture
from simharness.report.study.replay import Replay
from simharness.trial.stages.frame_tasks import renderer_of
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.lenses import intrinsics
from simharness.world.scene.playback import Playback

_BEARING, _PITCH = np.radians(-40.0), np.radians(24.0)  # from where it is seen
_AIM = (0.0, 0.0, 1.1)  # metres
_FAR = 1.55  # times the diagonal of the room
_FOV = 34.0  # degrees, horizontal


@dataclass(frozen=True)
class Diorama:
    """What an eye outside of the room sees of a frame; the walls in its way are left out.

    Attributes:
        replay: of a run.
        frame: of it.
        size: width and height, pixels.
    """

    replay: Replay
    frame: int
    size: tuple[int, int]

    @cached_property
    def eye(self) -> Camera:
        """From where it is seen."""
        diagonal = float(np.hypot(*self.replay.trial.scenario.room.size[:2]))
        toward = np.array([np.cos(_BEARING) * np.cos(_PITCH), np.sin(_BEARING) * np.cos(_PITCH), np.sin(_PITCH)])
        return look_at(_AIM + _FAR * diagonal * toward, _AIM, K=intrinsics(_FOV, self.size), size=self.size, name="eye")

    def picture(self, *, finer: int = 2) -> Picture:
        """Floor, far walls and things, nobody, on white; ``finer`` times as many pixels each way."""
        scene = self.replay.trial.scene
        state = Playback(scene).at(float(self.replay.time[self.frame]))
        things = zip(meshes_at(scene, state)[len(scene.bodies) :], scene.solids, strict=True)
        seen = [mesh for mesh, solid in things if solid.kind != "room" or not self._in_the_way(mesh.vertices)]
        lighting = replace(scene.lighting, background=(1.0, 1.0, 1.0))
        rgb = antialiased(renderer_of("raster"), scaled(self.eye, finer), seen, lighting=lighting)
        return Picture("The room", "", rgb)

    def _in_the_way(self, vertices: NDArray[np.floating]) -> bool:
        """Whether a part of the room stands on the eye's side of its middle."""
        return float(vertices[:, :2].mean(axis=0) @ self.eye.center[:2]) > 1e-6

    @property
    def truth(self) -> Floats:
        """Pixels of the true joints, (P, J, 2)."""
        return self.eye.project(self.replay.truth[self.frame].joints)

    @property
    def estimates(self) -> Floats:
        """Pixels of the estimated joints, (n, J, 2); NaN of those without a place."""
        return self.eye.project(self.replay.estimates[self.frame].joints)

    @property
    def cameras(self) -> Floats:
        """Pixels of each camera's centre and of the corners of what it sees close by, (V, 5, 2)."""
        return self.eye.project(np.stack([pyramid(camera) for camera in self.replay.trial.shots.believed]))
