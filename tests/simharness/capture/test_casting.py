"""What rays meet: closed forms, and MuJoCo's own rays one by one."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_renderers import camera_at

from simharness.capture.ray_casting import RayCaster
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.mujoco_model import SKIN_GROUP, bone_transforms, person_spec
from simharness.world.humans.shape import Shape

BODIES = tuple(make_body(Shape(gender=gender)) for gender in (0.0, 1.0))
PLACES = ((0.0, 0.0), (1.0, 0.4))


class Stage:
    """Two people at ``PLACES`` in a pose of their own, a box that stands and a ball that moves."""

    def __init__(self):
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(
            name="box",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[-1.0, 1.0, 0.5],
            size=[0.2, 0.3, 0.5],
            quat=[0.9, 0, 0, 0.4],
        )
        ball = spec.worldbody.add_body(name="ball", mocap=True)
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], pos=[0.0, 0.0, 0.2])
        for i, body in enumerate(BODIES):
            spec.attach(person_spec(body, f"person{i}"), prefix=f"person{i}/", frame=spec.worldbody.add_frame())
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.bodies, self.moving = BODIES, (SimpleNamespace(name="ball"),)
        self.state = self.posed(stream(1, "test", "pose"))

    def posed(self, rng, ball=(0.5, -1.0, 1.0, 1.0, 0.0, 0.0, 0.0)):
        """Joints bent at random within a third of their ranges; MuJoCo's data is left in that configuration."""
        model, data = self.model, self.data
        hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        low, high = model.jnt_range[hinge].T / 3
        data.qpos[model.jnt_qposadr[hinge]] = rng.uniform(low, high)
        for i, place in enumerate(PLACES):
            root = model.joint(f"person{i}/root").qposadr[0]
            data.qpos[root : root + 2] = place
        data.mocap_pos[0], data.mocap_quat[0] = ball[:3], ball[3:]
        mujoco.mj_kinematics(model, data)
        bones = []
        for i, body in enumerate(BODIES):
            rows = [model.body(f"person{i}/{bone}").id for bone in body.bones]
            bones.append(bone_transforms(body, data.xpos[rows], data.xmat[rows].reshape(-1, 3, 3)))
        return SimpleNamespace(bones=np.stack(bones), placements=np.array([ball]))

    def first_met(self, start, way):
        """By MuJoCo, one ray: whose surface it is (2 of a thing, -1 of nothing) and how far off."""
        geom = np.empty(1, np.int32)
        distance = mujoco.mj_ray(self.model, self.data, start, way, None, 1, -1, geom, None)
        if geom[0] < 0:
            return -1, np.inf
        name = self.model.body(self.model.geom_bodyid[geom[0]]).name
        return (int(name[6]) if name.startswith("person") else 2), distance


@pytest.fixture(scope="module")
def stage():
    return Stage()


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_everything_is_met_where_mujoco_meets_it(stage, seed):
    """From anywhere, also from within a body, towards the people and past them."""
    rng = stream(seed, "test", "rays")
    state = stage.posed(rng, ball=(*rng.uniform([-1, -1, 0.5], [1, 1, 1.5]), 1.0, 0.0, 0.0, 0.0))
    caster = RayCaster(stage)
    caster.place(state)
    camera = camera_at(rng.uniform([-3, -3, 0.1], [3, 3, 2.5]), rng.uniform([0, 0, 0.5], [1, 0.5, 1.5]))
    targets = camera.center + rng.uniform(0.5, 4.0, (30, 1)) * camera.rays(rng.uniform(0, 100, (30, 2)))
    owner, in_front = caster.cast(camera, targets)
    for target, who, metres in zip(targets, owner, in_front, strict=True):
        length = np.linalg.norm(target - camera.center)
        way = (target - camera.center) / length
        begin = 0.05 / (way @ camera.R[2])  # nothing nearer than the near plane is seen
        expected, distance = stage.first_met(camera.center + begin * way, way)
        if begin + distance >= length:
            assert (who, metres) == (-1, -np.inf)
        else:
            assert who == expected
            assert metres == pytest.approx(length - begin - distance, abs=1e-8)


def test_a_box_hides_what_is_behind_it_and_nothing_in_front(stage):
    caster = RayCaster(stage)
    caster.place(stage.state)
    camera = camera_at((-1.0, 4.0, 0.5), (-1.0, 1.0, 0.5))
    owner, in_front = caster.cast(camera, np.array([[-1.0, 0.0, 0.5], [-1.0, 2.0, 0.5]]))
    assert owner.tolist() == [2, -1]
    assert in_front[1] == -np.inf
    turn = 2 * np.arctan2(0.4, 0.9)
    half = min(0.3 / np.cos(turn), 0.2 / np.sin(turn))  # of the turned box along the ray through its middle
    assert in_front[0] == pytest.approx(1.0 + half, abs=1e-6)


def test_what_moves_is_met_where_it_is(stage):
    caster = RayCaster(stage)
    camera = camera_at((3.0, -1.0, 1.2), (0.0, -1.0, 1.2))
    target = np.array([[0.0, -1.0, 1.2]])
    for x in (0.5, 0.9):
        caster.place(stage.posed(stream(1, "test"), ball=(x, -1.0, 1.0, 1.0, 0.0, 0.0, 0.0)))
        owner, in_front = caster.cast(camera, target)
        assert owner.tolist() == [2]
        assert in_front[0] == pytest.approx(x + 0.1)  # the ball's near side, from the target
    caster.place(stage.posed(stream(1, "test"), ball=(0.5, -3.0, 1.0, 1.0, 0.0, 0.0, 0.0)))
    assert caster.cast(camera, target)[0].tolist() == [-1]


def test_nothing_nearer_than_the_near_plane_is_met(stage):
    """A lens 3 cm from a ball's surface, inside of it: only what comes after the ball's far side counts."""
    caster = RayCaster(stage)
    ball = (0.5, -1.0, 1.0, 1.0, 0.0, 0.0, 0.0)  # its centre is 20 cm above
    caster.place(stage.posed(stream(1, "test"), ball=ball))
    for behind, met in ((0.02, -1), (0.08, 2)):  # the far side is that far from the lens
        camera = camera_at((0.5 - 0.1 + behind, -1.0, 1.2), (-2.0, -1.0, 1.2))
        owner, _ = caster.cast(camera, np.array([[-1.0, -1.0, 1.2]]))
        assert owner.tolist() == [met]


def test_capsules_are_passed_by_only_if_they_are_out_of_the_way(stage):
    """Rays at the very edge of each capsule: just inside is met, just outside is not. No short cut may miss one."""
    state = stage.posed(stream(3, "test"))
    caster = RayCaster(stage)
    caster.place(state)
    camera = camera_at((4.0, 2.0, 1.3), (0.5, 0.2, 1.0))
    model, data = stage.model, stage.data
    for geom in np.flatnonzero(model.geom_group == SKIN_GROUP):
        middle, axis = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)[:, 2]
        away = (middle - camera.center) / np.linalg.norm(middle - camera.center)
        side = np.cross(axis, away)
        side /= np.linalg.norm(side)
        radius = model.geom_size[geom, 0]
        targets = np.stack([middle + share * radius * side + 0.3 * away for share in (-0.999, 0.999)])
        assert (caster.cast(camera, targets)[0] >= 0).all()


def test_no_targets(stage):
    caster = RayCaster(stage)
    caster.place(stage.state)
    owner, in_front = caster.cast(camera_at((3, 0, 1), (0, 0, 1)), np.zeros((0, 3)))
    assert owner.shape == in_front.shape == (0,)
