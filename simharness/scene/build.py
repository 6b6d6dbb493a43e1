"""From a scenario to a scene: who is there, how they move, what stands around them, all in one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from simharness.humans.body import Body, make_body
from simharness.humans.looks import draw_looks, dress, face_colors
from simharness.humans.model import person_spec
from simharness.humans.population import draw_shape
from simharness.motion.choreography import choreograph
from simharness.motion.kinematics import Kinematics
from simharness.motion.motion import Motion
from simharness.motion.trajectory import motion_clock
from simharness.random import stream
from simharness.rigs.layouts import build_rig
from simharness.scenario.models import Scenario
from simharness.scene.clutter import Solid
from simharness.scene.placement import BODY_HALF_WIDTH, FreeSpace, place_clutter
from simharness.scene.room import make_room

_WALL_MARGIN = 0.1  # metres between a camera and a wall
CLOCK_MARGIN = 1.0  # seconds that motions go on before and after: clocks of cameras are off by less


@dataclass(frozen=True)
class Scene:
    """Everything that a sequence and its pictures are made from.

    Attributes:
        model: people ("person0/..."), room and clutter in one MuJoCo model; what stands has geoms of its name.
        bodies: P bodies.
        motions: their motions, to be read at any time.
        solids: the room, then the clutter.
        skins: colour of every face of each body, (k, 3) float32 0..1.
        time: seconds, (T,).
    """

    model: mujoco.MjModel
    bodies: tuple[Body, ...]
    motions: tuple[Motion, ...]
    solids: tuple[Solid, ...]
    skins: tuple[NDArray[np.float32], ...]
    time: NDArray[np.float64]


def build(scenario: Scenario) -> Scene:
    """Build the scene of a scenario.

    Person i's body, look, path and manner come from streams of person i, so one more person changes none of the
    others; clutter is placed around the people's paths and the cameras and changes nobody.

    Raises:
        ValueError: people or clutter do not fit, naming the keys of the scenario to change.
    """
    seed, people = scenario.seed, scenario.people
    _check_area(scenario)
    time = np.arange(scenario.frames) / scenario.rate
    looks = draw_looks(seed, people.count)
    bodies = tuple(
        dress(make_body(draw_shape(stream(seed, "people", i, "shape"))), look) for i, look in enumerate(looks)
    )
    kinematics = [Kinematics(body) for body in bodies]
    motions = choreograph(scenario, kinematics, motion_clock(scenario.duration, margin=CLOCK_MARGIN)).motions
    pelvises = np.concatenate([np.zeros((0, 3)), *(motion.root[:, :3] for motion in motions)])
    joints = [
        body.joints(mover.transforms(m)).reshape(-1, 3)
        for body, mover, m in zip(bodies, kinematics, motions, strict=True)
    ]
    space = FreeSpace(
        room=scenario.room.size,
        area=people.area,
        pelvises=pelvises,
        joints=np.concatenate([np.zeros((0, 3)), *joints]),
        lenses=build_rig(scenario.cameras).centers,
    )
    clutter = place_clutter(seed, boxes=scenario.clutter.boxes, shelves=scenario.clutter.shelves, space=space)
    solids = make_room(scenario.room.size) + clutter
    skins = tuple(face_colors(body, look) for body, look in zip(bodies, looks, strict=True))
    return Scene(_compile(bodies, solids), bodies, motions, solids, skins, time)


def _compile(bodies: tuple[Body, ...], solids: tuple[Solid, ...]) -> mujoco.MjModel:
    """One MuJoCo model of everything."""
    spec = mujoco.MjSpec()
    spec.modelname = "scene"
    for solid in solids:
        for k, box in enumerate(solid.boxes):
            spec.worldbody.add_geom(
                name=solid.name if len(solid.boxes) == 1 else f"{solid.name} {k}",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=box.center,
                size=box.half,
                quat=[np.cos(box.yaw / 2), 0.0, 0.0, np.sin(box.yaw / 2)],
            )
    for i, body in enumerate(bodies):
        spec.attach(person_spec(body, f"person{i}"), prefix=f"person{i}/", frame=spec.worldbody.add_frame())
    return spec.compile()


def _check_area(scenario: Scenario) -> None:
    largest = min(scenario.room.size[:2]) / 2 - BODY_HALF_WIDTH
    if scenario.people.count and scenario.people.area > largest:
        raise ValueError(
            f"people.area = {scenario.people.area:g} m reaches into the walls of room.size = "
            f"{list(scenario.room.size)}: take people.area at most {largest:.2f}, or a larger room"
        )


def check_rig(scenario: Scenario, scene: Scene, rig: Rig) -> None:
    """Check that every camera hangs freely in the room.

    Raises:
        ValueError: a camera in or behind a wall or within 0.1 m of one, under the floor, above the walls, or inside
            of a thing; the message names the camera, where it is, what it is in, and how to mend it.
    """
    x, y, z = scenario.room.size
    limits = np.array([x / 2, y / 2]) - _WALL_MARGIN
    for camera in rig:
        place = camera.center
        where = f"camera {camera.name!r} at ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f}) m"
        if not 0.0 < place[2] <= z:
            side = "under the floor" if place[2] <= 0 else f"above the walls, which are {z:g} m high"
            raise ValueError(f"{where} is {side}: take cameras.height above 0 and at most {z:g}, or another room.size")
        beyond = np.abs(place[:2]) - limits
        if (beyond > 0).any():
            axis = int(beyond.argmax())
            name = f"wall {'+' if place[axis] > 0 else '-'}{'xy'[axis]}"
            far = abs(place[axis]) - scenario.room.size[axis] / 2
            how = f"{far:.2f} m beyond" if far > 0 else f"{-far:.2f} m from"
            raise ValueError(
                f"{where} is {how} {name} of the room, {x:g} by {y:g} m; it must stay {_WALL_MARGIN:g} m inside: take "
                f"cameras.radius at most {_largest_radius(rig, limits):.2f}, or a larger room.size"
            )
        for solid in scene.solids:
            if solid.kind == "clutter" and solid.hull.distance(place) == 0.0:
                raise ValueError(
                    f"{where} is inside of {solid.name}, which stands at ({solid.hull.center[0]:.2f}, "
                    f"{solid.hull.center[1]:.2f}) and is {solid.hull.corners[:, 2].max():.2f} m high: change "
                    "cameras.height, cameras.radius or cameras.start, or the clutter"
                )


def _largest_radius(rig: Rig, limits: NDArray[np.float64]) -> float:
    """The largest ring radius, rounded down to a centimetre, at which all cameras keep within the limits (2,)."""
    centers = rig.centers[:, :2]
    radius = np.linalg.norm(centers, axis=1, keepdims=True)
    reach = np.abs(centers) / np.maximum(radius, 1e-9)
    return float(np.floor(100 * (limits / np.maximum(reach, 1e-9)).min()) / 100)
