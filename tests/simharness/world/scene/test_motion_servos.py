"""Dynamic playback: gravity, joint servos, assistance, pushes and collisions."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from simharness.scenario.load import load
from simharness.scenario.sections.people_section import PushSection
from simharness.trial.stages.build_trial import build_trial
from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.mujoco_model import person_spec
from simharness.world.humans.shape import Shape
from simharness.world.motion.activities.round_loops import walk
from simharness.world.motion.motion import RATE, Motion, Trajectory, motion_clock
from simharness.world.motion.paths import make_loop
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.scene.dynamics.inverse_dynamics import InverseDynamics
from simharness.world.scene.dynamics.motion_servos import LEVER, MotionServos, Push, planned_push, track
from simharness.world.scene.objects.geoms import Box
from simharness.world.scene.objects.shapes import box_model

GRAVITY = 9.81
MAN = Kinematics(make_body(Shape(gender=0.1, height=0.42)))
WOMAN = Kinematics(make_body(Shape(gender=0.95, height=0.3, weight=0.7)))
CHILD = Kinematics(make_body(Shape(gender=0.4, age=0.35, height=0.5)))


def room(cast, *solids):
    """Model of a floor, people and solids."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0, 0, -0.05], size=[60, 60, 0.05])
    for solid in solids:
        solid.add_to(spec)
    for i, kinematics in enumerate(cast):
        person = person_spec(kinematics.body, f"person{i}")
        spec.attach(person, prefix=f"person{i}/", frame=spec.worldbody.add_frame())
    return spec.compile()


def standing(kinematics, *, duration=1.0, height=0.0, place=(0.0, 0.0), **degrees) -> Motion:
    """Plan of a person at rest in the neutral pose except for some angles, ``height`` metres over the floor."""
    time = motion_clock(duration)
    root = np.tile([*place, kinematics.standing_height + height, 1.0, 0, 0, 0], (len(time), 1))
    angles = np.zeros((len(time), len(DOFS)))
    for name, value in degrees.items():
        angles[:, DOFS.index(name)] = np.radians(value)
    return Motion(time, root, angles)


def walking(kinematics, *, start=(0.0, 0.0), ahead=1.0, duration=2.0, seed=1) -> Motion:
    """Plan of a person who walks almost straight along y, up (``ahead`` 1) or down (-1)."""
    around = np.linspace(0, 2 * np.pi, 800, endpoint=False)
    circle = 20 * ahead * np.stack([np.cos(around) - 1, np.sin(around)], axis=-1)
    loop = make_loop(np.asarray(start) + circle, speed=1.0, start=0.0)
    return walk(kinematics, loop, motion_clock(duration), rng=stream(seed, "walk"))


def misplaced(planned: Motion, happened: Motion) -> np.ndarray:
    """Distance of the pelvis from its plan, (T,), metres."""
    return np.linalg.norm(happened.root[:, :3] - planned.root[:, :3], axis=1)


def test_only_gravity_moves_the_centre_of_mass_in_the_air():
    """Independent of joint torques, it falls by g t^2 / 2."""
    plan = standing(MAN, height=3.0, duration=0.5, left_elbow_flexion=40.0)
    waving = replace(plan, angles=plan.angles + 0.8 * np.sin(9 * plan.time[:, None]) * (plan.angles > 0))
    servos = MotionServos(room([MAN]), [MAN.body], [waving], assist=1e-9)
    pelvis = servos.pelvises[0]
    heights, elbow = [], []
    for qpos in servos.run():
        mujoco.mj_kinematics(servos.model, servos.data)
        mujoco.mj_comPos(servos.model, servos.data)
        heights.append(servos.data.subtree_com[pelvis, 2])
        elbow.append(qpos[servos.hinges[0, DOFS.index("left_elbow_flexion")]])
    fallen = heights[0] - np.array(heights)
    time = plan.time - plan.time[0]
    # The elbow's first velocity lifts a little; and MuJoCo moves by the velocity at the end of a step.
    start = (fallen[1] - GRAVITY * time[1] * (time[1] + 1 / 480) / 2) / time[1]
    np.testing.assert_allclose(fallen, start * time + GRAVITY * time * (time + 1 / 480) / 2, atol=1e-3)
    assert abs(start) < 0.1
    assert np.ptp(elbow) > 0.5


def test_assistance_above_the_weight_carries_a_person():
    plan = standing(CHILD, height=1.0, duration=1.5)
    (held,) = track(room([CHILD]), [CHILD.body], [plan], assist=2 * GRAVITY * CHILD.body.mass)
    (let_go,) = track(room([CHILD]), [CHILD.body], [plan], assist=0.5 * GRAVITY * CHILD.body.mass)
    assert misplaced(plan, held).max() < 0.1
    assert misplaced(plan, let_go).max() > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("kinematics", [MAN, WOMAN, CHILD], ids=["man", "woman", "child"])
def test_free_walking_follows_the_plan(kinematics):
    plan = walking(kinematics, duration=3.0)
    (happened,) = track(room([kinematics]), [kinematics.body], [plan], assist=300.0)
    off = np.linalg.norm(kinematics.joints(happened) - kinematics.joints(plan), axis=-1)
    assert off.mean() < 0.03
    assert misplaced(plan, happened).max() < 0.05
    assert np.degrees(np.sqrt(np.mean((happened.angles - plan.angles) ** 2))) < 2.0
    assert misplaced(plan, happened).max() > 1e-3  # it is not the plan itself


@pytest.mark.slow
def test_a_walk_without_assistance_falls():
    plan = walking(MAN, duration=3.0)
    (happened,) = track(room([MAN]), [MAN.body], [plan], assist=1e-6)
    assert misplaced(plan, happened)[-1] > 0.4


def test_assistance_stays_within_its_bound():
    push = Push(person=0, start=0.3, duration=0.2, force=(1200.0, 0.0, 0.0))
    servos = MotionServos(room([MAN]), [MAN.body], [standing(MAN)], assist=150.0, pushes=[push])
    pelvis = servos.pelvises[0]
    forces, torques = [], []
    for _ in servos.run():
        if not 0.25 < servos.data.time + servos.time[0] < 0.55:
            forces.append(np.linalg.norm(servos.data.xfrc_applied[pelvis, :3]))
            torques.append(np.linalg.norm(servos.data.xfrc_applied[pelvis, 3:]))
    assert max(forces) <= 150.0 + 1e-9
    assert max(torques) <= 150.0 * LEVER + 1e-9
    assert max(forces) == pytest.approx(150.0)  # the bound is reached


@pytest.mark.slow
def test_a_push_displaces_and_a_small_one_is_recovered_from():
    plan = walking(MAN, duration=3.0)
    scene = room([MAN])

    def pushed(force: float) -> np.ndarray:
        push = Push(person=0, start=1.0, duration=0.2, force=(force, 0.0, 0.0))
        (happened,) = track(scene, [MAN.body], [plan], assist=300.0, pushes=[push])
        return misplaced(plan, happened)

    time = plan.time
    calm, small, great = pushed(0.0), pushed(400.0), pushed(2500.0)
    np.testing.assert_array_equal(small[time < 1.0], calm[time < 1.0])
    assert small.max() > calm.max() + 0.02
    assert small[-1] < 0.05
    assert great[-1] > 0.5


@pytest.mark.parametrize("place", ["pelvis", "chest", "left_shoulder"])
def test_a_push_changes_the_momentum_by_its_impulse(place):
    """In the air no other force acts along the floor: the centre of mass moves by J / m from the middle of the push."""
    section = PushSection(time=0.1, duration=0.1037, impulse=40.0, direction=90.0, place=place)
    plan = standing(MAN, height=3.0, duration=0.5)
    servos = MotionServos(room([MAN]), [MAN.body], [plan], assist=1e-9, pushes=planned_push(section, [plan]))
    pelvis, way, time = servos.pelvises[0], [], []
    for _ in servos.run():
        mujoco.mj_kinematics(servos.model, servos.data)
        mujoco.mj_comPos(servos.model, servos.data)
        way.append(servos.data.subtree_com[pelvis, :2].copy())
        time.append(servos.data.time + plan.time[0])
    moved, after = np.array(way) - way[0], np.array(time) - (0.1 + 0.1037 / 2)
    late = after > 0.1
    assert late.any()
    expected = section.impulse / servos.masses[0, 0] * after[late]
    np.testing.assert_allclose(moved[late, 1], expected, rtol=0.03)  # MuJoCo moves by the velocity at a step's end
    assert np.abs(moved[:, 0]).max() < 2e-3
    assert np.abs(moved[np.array(time) < 0.1]).max() < 1e-3


@pytest.mark.parametrize("start", [0.3, 0.3004, 0.31])
def test_the_shares_of_the_steps_add_up_to_the_duration(start):
    push, step = Push(0, start, 0.1037, (1.0, 0.0, 0.0)), 1 / 480
    shares = np.array([push.share(k * step, step) for k in range(480)])
    assert shares.sum() * step == pytest.approx(0.1037)
    assert shares.min() == 0.0
    assert shares.max() <= 1.0 + 1e-9


def test_the_direction_of_a_push_is_that_of_the_person():
    plan = standing(MAN)
    facing = np.radians(60.0)  # from the x axis
    root = plan.root.copy()
    root[:, 3:] = np.cos(facing / 2), 0.0, 0.0, np.sin(facing / 2)
    (push,) = planned_push(PushSection(impulse=50.0, duration=0.5, direction=90.0), [replace(plan, root=root)])
    bearing = facing + np.pi / 2
    np.testing.assert_allclose(push.force, [100 * np.cos(bearing), 100 * np.sin(bearing), 0.0], atol=1e-9)
    assert planned_push(PushSection(impulse=0.0), [plan]) == ()


def one_person(**push):
    """The shipped scenario with the pushed person alone: its scene."""
    keys = {"time": 0.5, **push}
    overrides = ["people.count=1", "duration=2.5", 'rendering.renderer="rays"']
    return build_trial(load("pushed", overrides=[*overrides, *(f"people.push.{k}={v}" for k, v in keys.items())])).scene


@pytest.mark.slow
def test_a_pushed_person_recovers_or_falls_within_the_limits_of_joints():
    calm, stumbling, falling = (one_person(impulse=impulse) for impulse in (0.0, 60.0, 150.0))
    limits = np.array([calm.model.joint(f"person0/{name}").range for name in DOFS])
    for scene in (calm, stumbling, falling):
        (motion,) = scene.motions
        beyond = np.maximum(limits[:, 0] - motion.angles, motion.angles - limits[:, 1]).max()
        assert np.degrees(beyond) < 10.0  # contacts bend joints a little beyond their limits, as anywhere in MuJoCo
    off = misplaced(calm.motions[0], stumbling.motions[0])
    assert off.max() > 0.1
    assert off[-1] < 0.05
    assert calm.motions[0].root[-1, 2] > 0.7
    assert falling.motions[0].root[-1, 2] < 0.3


@pytest.mark.slow
def test_nobody_is_pushed_by_an_impulse_of_zero():
    one, other = (scene.motions[0] for scene in (one_person(impulse=0), one_person(impulse=0, direction=90, time=0.2)))
    np.testing.assert_array_equal(one.root, other.root)
    np.testing.assert_array_equal(one.angles, other.angles)


@pytest.mark.slow
def test_people_whose_plans_intersect_collide():
    cast = [MAN, WOMAN]
    plans = [walking(MAN, start=(0.0, -1.2)), walking(WOMAN, start=(0.1, 1.2), ahead=-1.0, seed=2)]
    apart = np.linalg.norm(plans[0].root[:, :2] - plans[1].root[:, :2], axis=1)
    assert apart.min() < 0.15  # as planned
    servos = MotionServos(room(cast), [mover.body for mover in cast], plans, assist=300.0)
    owner = servos.model.body_rootid[servos.model.geom_bodyid]
    deepest, met = 0.0, False
    happened = []
    for qpos in servos.run():
        happened.append([qpos[root[:2]] for root in servos.roots])
        for contact in servos.data.contact:
            if 0 not in owner[contact.geom]:
                met = True
                deepest = min(deepest, contact.dist)
    assert met
    assert deepest > -0.03
    gap = np.linalg.norm(np.subtract(*np.moveaxis(np.array(happened), 1, 0)), axis=-1)
    assert gap.min() > 0.2


def block(kind, *, moving=True):
    """A box of 0.4 m at the height of the hips that moves along x at 1 m/s, through the origin at 0.8 s."""
    time = np.arange(-0.1, 2.0, 1 / RATE) if moving else np.zeros(1)
    pose = np.zeros((len(time), 7))
    pose[:, 3] = 1.0
    pose[:, 0] = np.minimum(time, 1.2) - 0.8 if moving else -0.5
    thing = box_model([Box((0.0, 0.0, 0.95), (0.2, 0.2, 0.2))], [(0.5, 0.5, 0.5)])
    return thing.along(Trajectory(time, pose), kind=kind, name="block")


@pytest.mark.parametrize(("kind", "moved"), [("clutter", True), ("prop", False)])
def test_a_cart_pushes_people_and_a_carried_prop_does_not(kind, moved):
    solid = block(kind)
    plan = standing(MAN, duration=1.4)
    (happened,) = track(room([MAN], solid), [MAN.body], [plan], assist=300.0, solids=[solid])
    assert (misplaced(plan, happened).max() > 0.2) == moved


def test_model_and_plan_are_unchanged_and_results_repeat():
    scene = room([MAN])
    before = (scene.opt.timestep, scene.dof_damping.copy(), scene.geom_size.copy())
    plan = walking(MAN, duration=0.5)
    (one,), (two,) = (track(scene, [MAN.body], [plan], assist=300.0) for _ in range(2))
    np.testing.assert_array_equal(one.root, two.root)
    np.testing.assert_array_equal(one.angles, two.angles)
    np.testing.assert_array_equal(one.time, plan.time)
    assert scene.opt.timestep == before[0]
    np.testing.assert_array_equal(scene.dof_damping, before[1])
    np.testing.assert_array_equal(scene.geom_size, before[2])


@pytest.mark.slow
def test_the_duration_does_not_change_earlier_frames():
    long, scene = walking(MAN, duration=3.0), room([MAN])
    short = Motion(long.time[:150], long.root[:150], long.angles[:150])
    (whole,), (part,) = (track(scene, [MAN.body], [plan], assist=300.0) for plan in (long, short))
    np.testing.assert_allclose(part.root[:140], whole.root[:140], atol=2e-3)


def test_without_people():
    assert track(room([]), [], [], assist=300.0) == ()


class Planned:
    """Plan of one person at rest, and the torques that it needs."""

    def __init__(self, height: float = 0.0, **degrees: float) -> None:
        plan = standing(MAN, height=height, **degrees)
        self.model = room([MAN])
        self.data = mujoco.MjData(self.model)
        hinges = [self.model.joint(f"person0/{name}") for name in DOFS]
        self.data.qpos[:7] = plan.root[0]
        self.data.qpos[[hinge.qposadr[0] for hinge in hinges]] = plan.angles[0]
        self._dofs = np.arange(6), np.array([hinge.dofadr[0] for hinge in hinges])
        mujoco.mj_kinematics(self.model, self.data)

    def torques(self) -> dict[str, float]:
        still = np.zeros(self.model.nv)
        efforts = InverseDynamics(self.model, *(np.array([dofs]) for dofs in self._dofs))
        (torques,) = efforts.torques(self.data.qpos, still, still, [])
        return dict(zip(DOFS, torques, strict=True))

    def moment(self, hinge: str, bone: str) -> float:
        """Moment of the weight of a bone and its descendants about a transverse hinge, N m, forward positive."""
        anchor = self.data.joint(f"person0/{hinge}").xanchor[0]
        below = [i for i in range(self.model.nbody) if self._hangs(i, self.model.body(f"person0/{bone}").id)]
        return GRAVITY * sum(self.model.body_mass[i] * (self.data.xipos[i, 0] - anchor) for i in below)

    def _hangs(self, body: int, bone: int) -> bool:
        while body > 0 and body != bone:
            body = self.model.body_parentid[body]
        return body == bone


def test_an_arm_held_out_needs_the_torque_of_its_weight():
    planned = Planned(height=1.0, left_shoulder_flexion=90.0)
    expected = planned.moment("left_shoulder_flexion", "LeftArm")
    assert expected > 5.0
    torques = planned.torques()
    assert torques["left_shoulder_flexion"] == pytest.approx(expected, rel=1e-6)
    assert abs(torques["right_elbow_flexion"]) < 0.3


def test_knees_carry_the_weight_in_a_crouch_but_not_in_the_air():
    """Statics: half the weight, under the centre of mass, at its lever about the knee, less that of the shank."""
    bent = {f"{side}_{name}": angle for side in ("left", "right")
            for name, angle in (("hip_flexion", 40), ("knee_flexion", 80), ("ankle_dorsiflexion", 40))}  # fmt: skip
    thigh, shank = MAN.leg_parts
    planned = Planned(height=-(thigh + shank) * (1 - np.cos(np.radians(40.0))), **bent)
    whole = planned.moment("left_knee_flexion", "Hips")  # negative: the weight is behind the knees
    expected = whole / 2 - planned.moment("left_knee_flexion", "LeftLeg")
    assert expected < -50.0
    torques = planned.torques()
    for side in ("left", "right"):
        assert torques[f"{side}_knee_flexion"] == pytest.approx(expected, rel=0.1)
    assert abs(Planned(height=1.0, **bent).torques()["left_knee_flexion"]) < 0.25 * abs(expected)
