"""From a scenario to a scene: who is there, how they move, what stands around them, all in one MuJoCo model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from simharness.scenario.sections.scenario import Scenario
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.types.random_streams import stream
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.clothing import dress, paint
from simharness.world.humans.population import draw_shape, is_child
from simharness.world.humans.wardrobe import Look, draw_looks
from simharness.world.motion.choreography import choreograph
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.trajectory import motion_clock
from simharness.world.scene.camera_clearance import check_rig
from simharness.world.scene.dynamics.tracking import track
from simharness.world.scene.objects.props import make_prop
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.placement.clutter import place_clutter
from simharness.world.scene.placement.decoys import place_decoys
from simharness.world.scene.placement.free_space import BODY_HALF_WIDTH, FreeSpace
from simharness.world.scene.rooms.lighting import room_lighting
from simharness.world.scene.rooms.room import make_room

CLOCK_MARGIN = 1.0  # seconds that motions go on before and after: clocks of cameras are off by less


@dataclass(frozen=True)
class Scene:
    """Everything that a sequence and its pictures are made from.

    Attributes:
        model: people ("person0/..."), room and things in one MuJoCo model; what stands has geoms of its name, what
            moves is a mocap body of its name.
        bodies: P bodies.
        figures: what is seen of each body, at rest.
        motions: their motions, to be read at any time.
        solids: the room, then the things in it.
        lighting: the light.
        time: seconds of the frames, (T,).
    """

    model: mujoco.MjModel
    bodies: tuple[Body, ...]
    figures: tuple[Mesh, ...]
    motions: tuple[Motion, ...]
    solids: tuple[Solid, ...]
    lighting: Lighting
    time: NDArray[np.float64]

    @property
    def moving(self) -> tuple[Solid, ...]:
        """The solids that move."""
        return tuple(solid for solid in self.solids if solid.trajectory is not None)

    @cached_property
    def mirrors(self) -> dict[int, Mirror]:
        """The glass of those that are mirrors, by their place among the people and solids."""
        first = len(self.bodies)
        return {first + k: solid.mirror for k, solid in enumerate(self.solids) if solid.mirror is not None}


def build(scenario: Scenario, rig: Rig) -> Scene:
    """Build the scene of a scenario.

    Person i's body, look, path and manner come from streams of person i, so one more person changes none of the
    others; things are placed around the people's paths and the cameras and change nobody.

    Args:
        scenario: what is asked for.
        rig: the cameras, which nothing may stand close to.

    Raises:
        ValueError: people, things or cameras do not fit, naming the keys of the scenario to change.
    """
    seed, people = scenario.seed, scenario.people
    _check_area(scenario)
    clock = motion_clock(scenario.duration, margin=CLOCK_MARGIN)
    looks = draw_looks(seed, people.count, look_alike=people.look_alike, alike=people.alike)
    bodies = tuple(
        dress(make_body(draw_shape(stream(seed, "people", i, "shape"), child=is_child(seed, i, people.children))), look)
        for i, look in enumerate(looks)
    )
    cast = [Kinematics(body) for body in bodies]
    plan = choreograph(scenario, cast, clock, widest=_largest_area(scenario))
    props = tuple(make_prop(prop, name=f"prop{k} {prop.kind}") for k, prop in enumerate(plan.props))
    motions = plan.motions
    pelvises = [motion.root[:, :3] for motion in motions]
    joints = [mover.joints(motion) for mover, motion in zip(cast, motions, strict=True)]
    space = FreeSpace(
        room=scenario.room,
        area=people.area,
        time=clock,
        pelvises=np.stack(pelvises, axis=1) if pelvises else np.zeros((len(clock), 0, 3)),
        joints=np.stack(joints, axis=1) if joints else np.zeros((len(clock), 0, 17, 3)),
        rig=rig,
        taken=props,
        around=people.around,
    )
    decoys = place_decoys(seed, scenario.decoys, space)
    clutter = place_clutter(seed, scenario.clutter, replace(space, taken=props + decoys))
    solids = (*make_room(scenario.room, seed), *props, *decoys, *clutter)
    check_rig(scenario, solids, rig)
    model = compile_model(cast, solids)
    if people.playback == "dynamic":
        motions = track(model, bodies, motions, assist=people.assist, solids=solids)
    figures = tuple(_figure(body, look) for body, look in zip(bodies, looks, strict=True))
    time = np.arange(scenario.frames) / scenario.rate
    return Scene(model, bodies, figures, motions, solids, room_lighting(scenario.room, seed), time)


def _figure(body: Body, look: Look) -> Mesh:
    coat = paint(body, look)
    return Mesh(
        vertices=body.vertices,
        faces=body.faces,
        colors=coat.colors,
        smooth=True,
        texture=coat.texture,
        uv=coat.uv,
        parts=body.segments,
    )


def compile_model(cast: Sequence[Kinematics], solids: Sequence[Solid]) -> mujoco.MjModel:
    """One MuJoCo model of everything: see :class:`Scene`."""
    spec = mujoco.MjSpec()
    spec.modelname = "scene"
    for solid in solids:
        solid.add_to(spec)
    for i, mover in enumerate(cast):
        spec.attach(mover.spec.copy(), prefix=f"person{i}/", frame=spec.worldbody.add_frame())
    return spec.compile()


def _largest_area(scenario: Scenario) -> float:
    """Return the largest ``people.area`` that the walls of the room allow, metres."""
    return min(scenario.room.size[:2]) / 2 - BODY_HALF_WIDTH


def _check_area(scenario: Scenario) -> None:
    largest = _largest_area(scenario)
    if scenario.people.count and scenario.people.area > largest:
        raise ValueError(
            f"people.area = {scenario.people.area:g} m reaches into the walls of room.size = "
            f"{list(scenario.room.size)}: take people.area at most {largest:.2f}, or a larger room"
        )
