import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simharness.humans.body import make_body
from simharness.humans.model import person_spec
from simharness.humans.population import draw_shape
from simharness.motion.chain import Chain
from simharness.motion.kinematics import Kinematics
from simharness.random import stream


@pytest.fixture(scope="module")
def kinematics():
    return Kinematics(make_body(draw_shape(stream(3, "chain"))))


@pytest.mark.parametrize("side", ["left", "right"])
def test_forward_is_what_mujoco_says(kinematics, side):
    chain = kinematics.legs[side]
    angles = stream(0, "angles", side).uniform(*chain.ranges.T, (20, 6))
    turns, places = chain.forward(angles)
    model = person_spec(kinematics.body, "someone").compile()
    data = mujoco.MjData(model)
    foot = f"{side.capitalize()}Foot"
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    mujoco.mj_kinematics(model, data)
    neutral = data.body(foot).xmat.reshape(3, 3).copy()
    for row, turn, place in zip(angles, turns, places, strict=True):
        for name, angle in zip(kinematics.leg_order, row, strict=True):
            data.joint(f"{side}_{name}").qpos = angle
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(place, data.body(foot).xpos, atol=1e-9)
        np.testing.assert_allclose(turn @ neutral, data.body(foot).xmat.reshape(3, 3), atol=1e-9)


def test_solve_meets_reachable_targets(kinematics):
    chain = kinematics.legs["left"]
    rng = stream(1, "targets")
    middle = np.radians([10, 0, 0, 40, 0, 0])
    wanted = np.clip(middle + rng.uniform(-0.3, 0.3, (50, 6)), *chain.ranges.T)
    turn, place = chain.forward(wanted)
    found = chain.solve(turn, place, start=np.tile(middle, (50, 1)))
    got_turn, got_place = chain.forward(found)
    assert np.abs(got_place - place).max() < 1e-8
    assert Rotation.from_matrix(got_turn.swapaxes(1, 2) @ turn).magnitude().max() < 1e-7


def test_solve_stays_in_range_where_the_target_is_out_of_reach(kinematics):
    chain = kinematics.legs["right"]
    far = chain.end + [0.0, 0.0, -0.5]
    found = chain.solve(np.eye(3)[None], far[None], start=np.zeros((1, 6)))
    assert (found >= chain.ranges[:, 0]).all()
    assert (found <= chain.ranges[:, 1]).all()
    # The straight leg is as near as the leg can come.
    straight = np.linalg.norm(chain.end - chain.anchors[0])
    assert np.linalg.norm(chain.forward(found)[1][0] - chain.anchors[0]) > 0.99 * straight


def test_two_hinges_by_hand():
    chain = Chain(
        axes=np.array([[0.0, 0, 1], [0, 0, 1]]),
        anchors=np.array([[0.0, 0, 0], [1, 0, 0]]),
        end=np.array([2.0, 0, 0]),
        ranges=np.radians([[-180.0, 180], [-180, 180]]),
    )
    turn, place = chain.forward(np.radians([[90.0, -90.0]]))
    np.testing.assert_allclose(place[0], [1, 1, 0], atol=1e-12)
    np.testing.assert_allclose(turn[0], np.eye(3), atol=1e-12)
