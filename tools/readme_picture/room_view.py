"""View of one frame of a trial by a camera outside the room: objects as a picture, people and cameras as pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mvpose import Camera
from mvpose.arrays import Floats
from mvpose.report.view_3d import camera_pyramid
from simharness.capture.picture import antialiased, meshes_at, scaled
from simharness.outputs.run.pictures import PagePicture
from simharness.outputs.study.skeleton_view_3d import Replay
from simharness.trial.stages.capture import renderer_of
from simharness.world.rigs.layouts import look_at
from simharness.world.rigs.projection import intrinsics
from simharness.world.scene.playback import Playback

_BEARING, _PITCH = np.radians(-40.0), np.radians(24.0)  # direction from the room to the camera
_AIM = (0.0, 0.0, 1.1)  # metres, the point in the middle of the picture
_DISTANCE = 1.55  # times the diagonal of the room
_FOV = 34.0  # degrees, horizontal
_PYRAMID = 0.34  # metres from a camera's centre to the base of its pyramid


@dataclass(frozen=True)
class RoomView:
    """A frame seen from outside the room, without the walls that hide the room.

    Attributes:
        replay: the trial.
        frame: frame index.
        size: width and height of the view in pixels.
    """

    replay: Replay
    frame: int
    size: tuple[int, int]

    @cached_property
    def eye(self) -> Camera:
        """Camera that takes the view."""
        diagonal = float(np.hypot(*self.replay.trial.scenario.room.size[:2]))
        toward = np.array([np.cos(_BEARING) * np.cos(_PITCH), np.sin(_BEARING) * np.cos(_PITCH), np.sin(_PITCH)])
        position = _AIM + _DISTANCE * diagonal * toward
        return look_at(position, _AIM, K=intrinsics(_FOV, self.size), size=self.size, name="eye")

    def picture(self, *, finer: int = 2) -> PagePicture:
        """Render the floor, the far walls and the objects without people, on a white background.

        Args:
            finer: rendered pixels for each pixel of the picture, in each direction.
        """
        scene = self.replay.trial.scene
        state = Playback(scene).at(float(self.replay.time[self.frame]))
        solids = zip(meshes_at(scene, state)[len(scene.bodies) :], scene.solids, strict=True)
        shown = [mesh for mesh, solid in solids if solid.kind != "room" or not self._hides_room(mesh.vertices)]
        lighting = replace(scene.lighting, background=(1.0, 1.0, 1.0), panorama=None, sources=None)  # no ceiling
        rgb = antialiased(renderer_of("raster"), scaled(self.eye, finer), shown, lighting=lighting)
        return PagePicture("The room", "", rgb)

    def _hides_room(self, vertices: NDArray[np.floating]) -> bool:
        """Return whether a part of the room stands between the middle of the room and the camera."""
        middle = vertices.mean(axis=0)
        above = middle[2] > 0.9 * self.replay.trial.scenario.room.size[2]  # ceiling and lamps
        return above or float(middle[:2] @ self.eye.center[:2]) > 1e-6

    @property
    def truth(self) -> Floats:
        """Pixels of the true joints, (P, J, 2)."""
        return self.eye.project(self.replay.truth[self.frame].joints)

    @property
    def estimates(self) -> Floats:
        """Pixels of the estimated joints, (n, J, 2); NaN for joints without an estimate."""
        return self.eye.project(self.replay.estimates[self.frame].joints)

    @property
    def cameras(self) -> Floats:
        """Pixels of each camera's centre and of the four base corners of its pyramid, (V, 5, 2)."""
        return self.eye.project(
            np.stack([camera_pyramid(camera, _PYRAMID) for camera in self.replay.trial.exposures.believed_rig])
        )
