"""What a rig is rehearsed for: the volume, its people and what hides them; and whether the rig may hang there."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from mvpose import Camera, Rig
from simharness.planning.planned_room import Room
from simharness.planning.room_keys import TargetKeys
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.room_section import ClutterSection
from simharness.types.floor import Volume
from simharness.world.scene.objects.geoms import Box

_WALL = 0.005  # metres that a camera on a wall may be within it, because files are rounded


@dataclass(frozen=True)
class RehearsalSetup:
    """People, their surroundings and the detector of a rehearsal.

    Attributes:
        volume: where people are.
        detector: profile of the detector (:func:`simharness.scenario.presets.read_profile`).
        people: number of people in the volume.
        space: floor and height of the room; None where it is unknown.
        obstacles: boxes that hide people.
        clutter: objects that the simulator places around the people, in the simulation alone.
        target: what a place must reach to be good.

    Raises:
        ValueError: no people.
    """

    volume: Volume
    detector: DetectorSection
    people: int = 4
    space: Volume | None = None
    obstacles: tuple[Box, ...] = ()
    clutter: ClutterSection = ClutterSection()
    target: TargetKeys = TargetKeys()

    def __post_init__(self) -> None:
        if self.people < 1:
            raise ValueError(f"people: expected 1 or more, got {self.people}")

    @classmethod
    def in_room(cls, room: Room) -> Self:
        """Return the setup that a room file describes."""
        keys = room.keys
        return cls(room.volume, room.detector, keys.people.count, room.space, room.blocking, keys.clutter, keys.target)

    def check(self, rig: Rig) -> None:
        """Check that cameras hang in the room and people can be in the volume.

        Raises:
            ValueError: a camera under the floor, outside of the room, above its ceiling or inside an obstacle, or a
                volume that is not inside the room. The message names the camera, where it is, and what to change.
        """
        for camera in rig:
            where = _where(camera)
            if camera.center[2] <= 0.0:
                raise ValueError(
                    f"{where} is not above the floor, which is at z = 0: move it, or move the calibration's origin to "
                    "the floor, with z up"
                )
            if self.space is not None:
                _check_in_room(camera, self.space, where)
            for number, obstacle in enumerate(self.obstacles):
                if _inside(camera, obstacle):
                    x, y, z = obstacle.center
                    raise ValueError(
                        f"{where} is inside obstacle {number}, whose middle is at ({x:.2f}, {y:.2f}, {z:.2f}) m: move "
                        "one of them"
                    )
        if self.space is not None:
            away = self.space.distance(self.volume.outline)
            if away.max() > _WALL:
                x, y = self.volume.outline[away.argmax()]
                raise ValueError(
                    f"--volume: its corner ({x:.2f}, {y:.2f}) m is outside of the room {_span(self.space)}: make the "
                    "volume smaller, or correct the room"
                )


def _check_in_room(camera: Camera, space: Volume, where: str) -> None:
    away = float(space.distance(camera.center[:2]))
    if away > _WALL:
        raise ValueError(
            f"{where} is {away:.2f} m outside of the room {_span(space)}, in or behind a wall: move the camera, or "
            "correct the room"
        )
    if camera.center[2] > space.height + _WALL:
        raise ValueError(
            f"{where} is above the ceiling, which is {space.height:g} m high: move the camera, or correct the room"
        )


def _inside(camera: Camera, obstacle: Box) -> bool:
    local = (camera.center - obstacle.center) @ obstacle.axes
    return bool((np.abs(local) < obstacle.half).all())


def _where(camera: Camera) -> str:
    x, y, z = camera.center
    return f"camera {camera.name!r} at ({x:.2f}, {y:.2f}, {z:.2f}) m"


def _span(space: Volume) -> str:
    low, high = np.round(space.bounds, 9)
    return f"({low[0]:g} to {high[0]:g} m along x, {low[1]:g} to {high[1]:g} m along y)"
