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
    """Two people at ``PLACES`` in different poses, a box at rest and a moving ball."""

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
        """Bend joints at random within a third of their ranges; the MuJoCo data keeps that configuration."""
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
        """Cast one ray by MuJoCo: owner of the surface (2 an object, -1 none) and its distance."""
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
def test_hits_agree_with_mujoco(stage, seed):
    """From any position, also inside a body, towards the people and past them."""
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
        begin = 0.05 / (way @ camera.R[2])  # the near plane
        expected, distance = stage.first_met(camera.center + begin * way, way)
        if begin + distance >= length:
            assert (who, metres) == (-1, -np.inf)
        else:
            assert who == expected
            assert metres == pytest.approx(length - begin - distance, abs=1e-8)


def test_a_box_occludes_only_targets_behind_it(stage):
    caster = RayCaster(stage)
    caster.place(stage.state)
    camera = camera_at((-1.0, 4.0, 0.5), (-1.0, 1.0, 0.5))
    owner, in_front = caster.cast(camera, np.array([[-1.0, 0.0, 0.5], [-1.0, 2.0, 0.5]]))
    assert owner.tolist() == [2, -1]
    assert in_front[1] == -np.inf
    turn = 2 * np.arctan2(0.4, 0.9)
    half = min(0.3 / np.cos(turn), 0.2 / np.sin(turn))  # of the turned box along the ray through its middle
    assert in_front[0] == pytest.approx(1.0 + half, abs=1e-6)


def test_moving_solids_are_hit_at_their_positions(stage):
    caster = RayCaster(stage)
    camera = camera_at((3.0, -1.0, 1.2), (0.0, -1.0, 1.2))
    target = np.array([[0.0, -1.0, 1.2]])
    for x in (0.5, 0.9):
        caster.place(stage.posed(stream(1, "test"), ball=(x, -1.0, 1.0, 1.0, 0.0, 0.0, 0.0)))
        owner, in_front = caster.cast(camera, target)
        assert owner.tolist() == [2]
        assert in_front[0] == pytest.approx(x + 0.1)  # the near side of the ball, from the target
    caster.place(stage.posed(stream(1, "test"), ball=(0.5, -3.0, 1.0, 1.0, 0.0, 0.0, 0.0)))
    assert caster.cast(camera, target)[0].tolist() == [-1]


def test_nothing_before_the_near_plane_is_hit(stage):
    """A camera inside a ball, 3 cm from its surface: only hits behind the far side count."""
    caster = RayCaster(stage)
    ball = (0.5, -1.0, 1.0, 1.0, 0.0, 0.0, 0.0)  # its centre is 20 cm above
    caster.place(stage.posed(stream(1, "test"), ball=ball))
    for behind, met in ((0.02, -1), (0.08, 2)):  # distance of the far side from the camera
        camera = camera_at((0.5 - 0.1 + behind, -1.0, 1.2), (-2.0, -1.0, 1.2))
        owner, _ = caster.cast(camera, np.array([[-1.0, -1.0, 1.2]]))
        assert owner.tolist() == [met]


def test_capsules_are_skipped_only_if_the_ray_misses_them(stage):
    """Rays at the edge of each capsule: just inside is a hit, just outside is not; skipping must not lose one."""
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
