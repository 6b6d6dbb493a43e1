"""Construction of a scene from a scenario: people, motions, room and objects in one MuJoCo model.

People before they move depend on their shape and look alone and take half of the time in which a scene is built. Scenes
that differ in cameras, clutter, faults or detector have the same people, so a process keeps the people whom it made
last.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from mvpose.camera import Rig
from simharness.scenario.sections.scenario import Scenario
from simharness.types.lighting import Lighting
from simharness.types.mesh import Mesh
from simharness.types.mirror import Mirror
from simharness.types.random_streams import stream
from simharness.world.humans.accessories import plain, wear
from simharness.world.humans.body import Body, make_body
from simharness.world.humans.clothing import dress
from simharness.world.humans.figure import figure_mesh
from simharness.world.humans.population import draw_shape, is_child
from simharness.world.humans.shape import Shape
from simharness.world.humans.wardrobe import Look, camouflaged, draw_looks
from simharness.world.motion.choreography import choreograph
from simharness.world.motion.mocap import load_people, recorded_shape
from simharness.world.motion.motion import Motion, Presence, held, motion_clock
from simharness.world.motion.poses.kinematics import Cast, Kinematics
from simharness.world.scene.dynamics.motion_servos import planned_push, track
from simharness.world.scene.objects.laboratory import make_prop
from simharness.world.scene.objects.solids import Solid
from simharness.world.scene.placement.clutter import place_clutter, place_decoys, place_furniture
from simharness.world.scene.placement.free_space import BODY_HALF_WIDTH, FreeSpace, check_rig
from simharness.world.scene.rooms.kinds import check_size, settled
from simharness.world.scene.rooms.lamps import area_lights, has_ceiling
from simharness.world.scene.rooms.openings import draw_openings
from simharness.world.scene.rooms.room_lighting import room_lighting
from simharness.world.scene.rooms.shell import make_interior, wall_color

CLOCK_MARGIN = 1.0  # seconds of motion before and after the sequence: clock errors of cameras are smaller
_KEPT = 24  # people, about 5 MB each: those of a scene and of the next ones


@dataclass(frozen=True)
class ScenePerson:
    """One person in the rest pose. Several scenes may share it, so its arrays are never changed."""

    look: Look
    """Clothes, hair and accessories."""
    body: Body
    """Dressed body with accessories."""
    mover: Kinematics
    """Kinematics of the body of the plain look (:func:`~simharness.world.humans.accessories.plain`). Poses are computed
    in its MuJoCo data, so threads must not share it."""

    @cached_property
    def figure(self) -> Mesh:
        """Visible mesh of body and clothing in the rest pose."""
        return figure_mesh(self.body, self.look)


@dataclass(frozen=True)
class Scene:
    """People, objects, motions and lighting from which a sequence and its pictures are made."""

    model: mujoco.MjModel
    """MuJoCo model of people ("person0/..."), room and objects; solids at rest have geoms of their name, moving ones
    are mocap bodies of their name."""
    bodies: tuple[Body, ...]
    """Bodies of the P people."""
    figures: tuple[Mesh, ...]
    """Visible meshes of the people (body and clothing) in the rest pose."""
    motions: tuple[Motion, ...]
    """Motions of the people, which can be sampled at any time."""
    presence: tuple[Presence, ...]
    """Times at which each person is in the scene."""
    solids: tuple[Solid, ...]
    """Room (its fittings have no geoms), then objects."""
    lighting: Lighting
    """Lighting of the scene."""
    time: NDArray[np.float64]
    """Times of the frames, (T,), seconds."""

    @property
    def moving(self) -> tuple[Solid, ...]:
        """Moving solids."""
        return tuple(solid for solid in self.solids if solid.trajectory is not None)

    @cached_property
    def mirrors(self) -> dict[int, Mirror]:
        """Glass of the solids that are mirrors, by their mesh index among people and solids."""
        first = len(self.bodies)
        return {first + k: solid.mirror for k, solid in enumerate(self.solids) if solid.mirror is not None}


def build(scenario: Scenario, rig: Rig) -> Scene:
    """Build the scene of a scenario.

    Body, appearance, path and movement style of person i come from streams of person i, so one more person changes none
    of the others; objects are placed around the paths of the people and the cameras, and do not change the people.

    Args:
        scenario: scenario of the scene.
        rig: true cameras, which objects must not be close to.

    Raises:
        ValueError: people, objects or cameras do not fit; the message names the keys of the scenario to change.
    """
    scenario = scenario.model_copy(update={"room": settled(scenario.room, scenario.seed)})
    seed, people, room = scenario.seed, scenario.people, scenario.room
    check_size(room)
    _check_area(scenario)
    clock = motion_clock(scenario.duration, margin=CLOCK_MARGIN)
    looks = draw_looks(seed, people.count, look_alike=people.look_alike, alike=people.alike)
    if people.camouflage:
        walls = wall_color(room, seed)
        looks = tuple(camouflaged(look, walls, people.camouflage) for look in looks)
    cast = tuple(make_person(shape, look) for shape, look in zip(_shapes(scenario), looks, strict=True))
    movers = [person.mover for person in cast]
    plan = choreograph(scenario, movers, clock, widest=_largest_area(scenario), cameras=rig.centers)
    props = tuple(make_prop(prop, name=f"prop{k} {prop.kind}") for k, prop in enumerate(plan.props))
    motions = plan.motions
    present = [presence.at(clock) for presence in plan.presence]
    pelvises = [held(motion.root[:, :3], here) for motion, here in zip(motions, present, strict=True)]
    joints = [held(mover.joints(motion), here) for mover, motion, here in zip(movers, motions, present, strict=True)]
    space = FreeSpace(
        room=room,
        area=people.area,
        time=clock,
        pelvises=np.stack(pelvises, axis=1) if pelvises else np.zeros((len(clock), 0, 3)),
        joints=np.stack(joints, axis=1) if joints else np.zeros((len(clock), 0, 17, 3)),
        rig=rig,
        taken=props,
        around=people.around,
    )
    decoys = place_decoys(seed, scenario.decoys, space)
    openings = draw_openings(room, seed, props + decoys)
    areas = area_lights(room, seed, openings) if has_ceiling(room, rig) else ()
    furniture = place_furniture(seed, replace(space, taken=props + decoys), openings)
    clutter = place_clutter(seed, scenario.clutter, replace(space, taken=props + decoys + furniture))
    objects = (*furniture, *props, *decoys, *clutter)
    solids = (*make_interior(room, seed, rig, openings=openings, areas=areas, objects=objects), *objects)
    check_rig(scenario, solids, rig)
    bodies = tuple(person.body for person in cast)
    model = compile_model(movers, solids)
    if people.playback == "dynamic":
        push = planned_push(people.push, motions)
        motions = track(model, bodies, motions, assist=people.assist, solids=solids, pushes=push)
    figures = tuple(person.figure for person in cast)
    time = np.arange(scenario.frames) / scenario.rate
    return Scene(model, bodies, figures, motions, plan.presence, solids, room_lighting(room, seed, areas), time)


def _shapes(scenario: Scenario) -> list[Shape]:
    """Return the shapes of all people; people who re-enact recorded ones have their size."""
    seed, people = scenario.seed, scenario.people
    shapes = [shape_of_person(seed, i, people.children) for i in range(people.count)]
    if not people.motion.tracks:
        return shapes
    recorded = load_people(people)
    return [recorded_shape(shape, recorded, i) for i, shape in enumerate(shapes)]


def compile_model(cast: Cast, solids: Sequence[Solid]) -> mujoco.MjModel:
    """Compile people and solids to one MuJoCo model: see :class:`Scene`."""
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
    if scenario.people.count and scenario.people.area > largest and not scenario.people.motion.tracks:
        raise ValueError(
            f"people.area = {scenario.people.area:g} m does not fit between the walls of room.size = "
            f"{list(scenario.room.size)}: use people.area of at most {largest:.2f} or a larger room.size"
        )


@lru_cache(maxsize=_KEPT)
def make_person(shape: Shape, look: Look) -> ScenePerson:
    """Return the person of a shape and look, made once in a process."""
    bare, simple = make_body(shape), plain(look)
    moved = dress(bare, simple)
    same = (look.hat, look.hair_style) == (simple.hat, simple.hair_style)
    return ScenePerson(look, wear(moved if same else dress(bare, look), look), Kinematics(moved))


@lru_cache(maxsize=_KEPT)
def shape_of_person(seed: int, person: int, children: float) -> Shape:
    """Return the shape of a person of a scene, drawn from the streams of that person.

    Args:
        seed: seed of the scene.
        person: index of the person.
        children: share of people who are children, 0 to 1.
    """
    return draw_shape(stream(seed, "people", person, "shape"), child=is_child(seed, person, children))
