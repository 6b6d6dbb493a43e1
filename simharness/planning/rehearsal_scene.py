"""Scenes in which a rig is rehearsed: people who walk, stand and reach in the volume, on an open floor.

The simulator has people around the origin: the smallest rectangle around the volume becomes one around the origin.

What a rig is rehearsed for is a volume, its people and what hides them; the rig must be able to hang there.
"""

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose import Camera, Rig
from mvpose.arrays import Floats
from simharness.planning.planned_room import Room
from simharness.planning.room_keys import TargetKeys
from simharness.scenario.sections.detector_section import DetectorSection
from simharness.scenario.sections.room_section import ClutterSection
from simharness.scenario.sections.scenario import Scenario
from simharness.scoring.frame_scores import RULES, HeadRule
from simharness.types.floor import Volume
from simharness.world.humans.accessories import take_off
from simharness.world.motion.paths import rotation_2d
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.scene.build import Scene, build, compile_model
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import box_mesh
from simharness.world.scene.objects.solids import Solid

_WALL = 0.005  # metres that a camera on a wall may be within it, because files are rounded


@dataclass(frozen=True)
class RehearsalSetup:
    """People, their surroundings and the detector of a rehearsal.

    Raises:
        ValueError: no people.
    """

    volume: Volume
    """Where people are."""
    detector: DetectorSection
    """Profile of the detector (:func:`simharness.scenario.presets.read_profile`)."""
    people: int = 4
    """Number of people in the volume."""
    space: Volume | None = None
    """Floor and height of the room; None where it is unknown."""
    obstacles: tuple[Box, ...] = ()
    """Boxes that hide people."""
    clutter: ClutterSection = ClutterSection()
    """Objects that the simulator places around the people, in the simulation alone."""
    target: TargetKeys = TargetKeys()
    """What a place must reach to be good."""

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


ACTIVITIES = ("walk", "wave", "walk", "reach")
"""Activities of the people, in turn: half of them walk."""

_STANDING = ("wave", "reach", "point")  # in a volume too small to walk in
_LEAST_WALK = 0.7  # metres: half the side of the smallest square in which people walk
_ROOM_TO_WALK = 1.2  # square metres for each person: in a denser crowd people stand
_SPACINGS = (0.8, 0.6, 0.45)  # metres between pelvises: the first at which the people fit
_OBSTACLE = (0.6, 0.6, 0.62)  # colour; obstacles are never rendered
_MARGIN = 2.0  # metres of floor beyond cameras and people


@dataclass(frozen=True)
class SceneSettings:
    """What all scenes have in common."""

    rig: Rig
    """Cameras in the world, floor at z = 0."""
    setup: RehearsalSetup
    """The volume, its people, what hides them, and the detector. With clutter, people use the square around the
    volume."""
    activities: tuple[str, ...] = ACTIVITIES
    """Activities of the people, in turn."""
    frames: int = 8
    """Frames of a take; a scene has four takes, or one with clutter."""
    rate: float = 2.0
    """Frames per second."""
    variant: str = "full"
    """Variant of the method."""
    head: HeadRule = RULES[0]
    """Rule for the head joints of PCP."""
    whole: tuple[int, ...] = ()
    """Indices of the cameras of the maps; all by default."""


@dataclass(frozen=True)
class SceneFrame:
    """Position of a volume's rectangle in the world of the rig."""

    center: Floats
    """Middle of the rectangle, (2,), metres."""
    bearing: float
    """Direction of its first side from the world's x axis, radians."""
    half: Floats
    """Half its sides, (2,), metres."""

    @classmethod
    def around(cls, outline: Floats) -> "SceneFrame":
        """Return the frame of the rectangle of least area around a polygon (n, 2), metres.

        One side of that rectangle lies on a side of the convex hull (Freeman and Shapira, Communications of the ACM
        1975); of equal ones the first is taken, so that an upright rectangle keeps its axes.
        """
        from scipy.spatial import ConvexHull

        hull = outline[ConvexHull(outline).vertices]
        sides = np.roll(hull, -1, axis=0) - hull
        # In the first quadrant, smallest first: a rectangle's sides are equivalent, and 0 keeps the axes.
        bearings = np.unique(np.round(np.arctan2(sides[:, 1], sides[:, 0]) % (np.pi / 2), 9))
        frames = [cls._at(hull, float(bearing)) for bearing in bearings]
        return min(frames, key=lambda frame: round(float(frame.half.prod()), 9))

    @classmethod
    def _at(cls, points: Floats, bearing: float) -> "SceneFrame":
        local = points @ rotation_2d(bearing)
        low, high = local.min(axis=0), local.max(axis=0)
        return cls(rotation_2d(bearing) @ ((low + high) / 2), bearing, (high - low) / 2)

    @property
    def axes(self) -> Floats:
        """Axes of the rectangle in the world as columns, (2, 2)."""
        return rotation_2d(self.bearing)

    def to_world(self, places: Floats) -> Floats:
        """Return places (..., 2) of the scene in the world, metres."""
        return places @ self.axes.T + self.center

    def to_scene(self, places: Floats) -> Floats:
        """Return places (..., 2) of the world in the scene, metres."""
        return (places - self.center) @ self.axes

    def rig(self, rig: Rig) -> Rig:
        """Return a rig of the world in the scene."""
        turn, shift = np.eye(3), np.array([*self.center, 0.0])
        turn[:2, :2] = self.axes
        return Rig([replace(each, R=each.R @ turn, t=each.R @ shift + each.t) for each in rig])


def scenario_of(settings: SceneSettings, frame: SceneFrame, seed: int) -> Scenario:
    """Return the scenario of a scene; its people fill a square as large as the rectangle of the volume."""
    half = float(np.sqrt(frame.half.prod()))
    reach = 2 * max(half, float(np.abs(frame.rig(settings.rig).centers[:, :2]).max())) + 2 * _MARGIN
    roomy = half >= _LEAST_WALK and 4 * half**2 >= _ROOM_TO_WALK * settings.setup.people
    activities = settings.activities if roomy else _STANDING
    content: dict[str, Any] = {
        "name": "rehearsal",
        "seed": seed,
        "duration": settings.frames / settings.rate,
        "rate": settings.rate,
        "room": {"size": (reach, reach, 3.0), "walls": False},
        "people": {"count": settings.setup.people, "area": half, "activities": activities, "spacing": _SPACINGS[0]},
        "clutter": settings.setup.clutter,
        "rendering": {"renderer": "rays"},
    }
    return Scenario.model_validate(content)


def build_scene(scenario: Scenario, rig: Rig) -> Scene:
    """Build a scene with the largest of the distances between people at which they fit.

    Raises:
        ValueError: people do not fit at any, or clutter does not.
    """
    for spacing in (each for each in _SPACINGS if _may_fit(scenario, each)):
        people = scenario.people.model_copy(update={"spacing": spacing})
        try:
            return build(scenario.model_copy(update={"people": people}), rig)
        except ValueError as error:
            if "do not fit" not in str(error):
                raise
    raise ValueError(
        f"{scenario.people.count} people do not fit into the volume, {_SPACINGS[-1]:g} m apart: use fewer people or a "
        "larger volume"
    )


def spread_over_volume(scene: Scene, settings: SceneSettings, frame: SceneFrame, take: int) -> Scene:
    """Return a scene whose people are spread over the rectangle of the volume, with the obstacles.

    The simulator keeps people in a square. It is turned by a right angle for each take, so that people who stand are at
    several places, and stretched to the rectangle of the same area.
    """
    turn = Rotation.from_euler("z", 90.0 * take, degrees=True)
    stretch = frame.half / np.sqrt(frame.half.prod())
    motions = tuple(replace(each, root=_moved(each.root, turn, stretch)) for each in scene.motions)
    scene = replace(scene, motions=motions)
    if not settings.setup.obstacles:
        return scene
    obstacles = tuple(_solid(each, frame, number) for number, each in enumerate(settings.setup.obstacles))
    solids = (*scene.solids, *obstacles)
    return replace(
        scene, solids=solids, model=compile_model([Kinematics(take_off(body)) for body in scene.bodies], solids)
    )


def _may_fit(scenario: Scenario, spacing: float) -> bool:
    """Return whether discs of this diameter around all people have the room for it, in the densest packing."""
    side = 2 * scenario.people.area + spacing
    return scenario.people.count * spacing**2 * np.sqrt(3) / 2 <= side**2


def _moved(root: Floats, turn: Rotation, stretch: Floats) -> Floats:
    """Return poses of pelvises (T, 7) turned about the vertical axis, their places then stretched along x and y."""
    places = root[:, :3] @ turn.as_matrix().T
    places[:, :2] *= stretch
    turned = (turn * Rotation.from_quat(root[:, [4, 5, 6, 3]])).as_quat()  # SciPy has w last
    return np.concatenate([places, turned[:, [3, 0, 1, 2]]], axis=1)


def has_objects(clutter: ClutterSection) -> bool:
    """Return whether there are objects."""
    return any(clutter.model_dump().values())


def _solid(obstacle: Box, frame: SceneFrame, number: int) -> Solid:
    """Return an obstacle of the world as a solid of the scene."""
    x, y = frame.to_scene(np.array(obstacle.center[:2])).tolist()
    box = Box((x, y, obstacle.center[2]), obstacle.half, obstacle.yaw - frame.bearing)
    return Solid("clutter", f"obstacle{number}", box_mesh([box], [_OBSTACLE]), (box,), box)
