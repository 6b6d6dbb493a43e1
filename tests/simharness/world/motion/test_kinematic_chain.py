import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import ARM, LEG
from simharness.world.humans.body import make_body
from simharness.world.humans.mujoco_model import person_spec
from simharness.world.humans.population import draw_shape
from simharness.world.motion.poses.kinematic_chain import Chain
from simharness.world.motion.poses.kinematics import Kinematics


@pytest.fixture(scope="module")
def kinematics():
    return Kinematics(make_body(draw_shape(stream(3, "chain"))))


def posed(kinematics, **angles):
    """Return MuJoCo data of the person with the pelvis at the origin and hinges at angles."""
    model = person_spec(kinematics.body, "someone").compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    for name, angle in angles.items():
        data.joint(name).qpos = angle
    mujoco.mj_kinematics(model, data)
    return data


@pytest.mark.slow
@pytest.mark.parametrize("side", ["left", "right"])
def test_trunk_and_arm_agree_with_mujoco(kinematics, side):
    trunk, arm = kinematics.trunks[side], kinematics.arms[side]
    rng = stream(0, "arms", side)
    hand = f"{side.capitalize()}Hand"
    neutral = posed(kinematics).body(hand)
    at_rest, turn_at_rest = neutral.xpos.copy(), neutral.xmat.reshape(3, 3).copy()
    for _ in range(10):
        bends, swings = rng.uniform(*trunk.ranges.T), rng.uniform(*arm.ranges.T)
        names = [*kinematics.trunk_order(side), *(f"{side}_{name}" for name in ARM)]
        data = posed(kinematics, **dict(zip(names, [*bends, *swings], strict=True)))
        (base,), (origin,) = trunk.forward(bends[None])
        (turn,), (place,) = arm.forward(swings[None])
        # The palm is fixed to the hand.
        moved = data.body(hand).xmat.reshape(3, 3) @ turn_at_rest.T @ (arm.end - at_rest) + data.body(hand).xpos
        np.testing.assert_allclose(base @ place + origin, moved, atol=1e-9)
        np.testing.assert_allclose(base @ turn @ turn_at_rest, data.body(hand).xmat.reshape(3, 3), atol=1e-9)


def test_palms_are_on_the_skin_and_face_the_thighs(kinematics):
    left, right = (kinematics.arms[side].end for side in ("left", "right"))
    np.testing.assert_allclose(left, right * [1, -1, 1], atol=1e-3)
    skin = kinematics.neutral_skin
    assert np.linalg.norm(skin - left, axis=1).min() < 0.01
    wrist = posed(kinematics).body("LeftHand").xpos
    assert 0.03 < wrist[2] - left[2] < 0.09
    assert 0.003 < wrist[1] - left[1] < 0.04  # palms face the thighs


@pytest.mark.parametrize("side", ["left", "right"])
def test_forward_kinematics_agrees_with_mujoco(kinematics, side):
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
        for name, angle in zip(LEG, row, strict=True):
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


def test_a_free_chain_stays_near_its_start_and_moves_smoothly(kinematics):
    arm = kinematics.arms["left"]
    start = np.radians([40.0, 10, 0, 50, 0, 0])
    t = np.linspace(0, 1, 60)[:, None]
    place = arm.anchors[0] + [0.15, 0.0, -0.4] + t * [0.15, 0.1, 0.3]
    found = arm.solve(None, place, start=np.tile(start, (60, 1)), pull=0.01)
    assert np.linalg.norm(arm.forward(found)[1] - place, axis=1).max() < 0.002
    assert np.abs(np.diff(found, axis=0)).max() < 0.1
    # Of all solutions it is the one nearest to the start: any other that reaches as well is further off.
    rng = stream(2, "others")
    for row, goal in zip(found[::20], place[::20], strict=True):
        others = arm.solve(None, np.tile(goal, (30, 1)), start=row + rng.normal(0, 0.2, (30, 6)))
        reached = np.linalg.norm(arm.forward(others)[1] - goal, axis=1) < 1e-3
        assert reached.sum() > 20
        assert np.linalg.norm(others[reached] - start, axis=1).min() > np.linalg.norm(row - start) - 0.02


def test_hinges_at_their_limit_leave_the_rest_to_the_others():
    chain = Chain(
        axes=np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, 1]]),
        anchors=np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]),
        end=np.array([3.0, 0, 0]),
        ranges=np.radians([[-10.0, 10], [-180, 180], [-180, 180]]),
    )
    goal = np.array([[0.8, 1.4, 0.0]])
    found = chain.solve(None, goal, start=np.radians([[5.0, 60.0, 20.0]]))
    np.testing.assert_allclose(chain.forward(found)[1], goal, atol=1e-6)
    assert np.abs(np.degrees(found[0, 0])) <= 10 + 1e-9


def test_follow_does_not_jump_between_solutions(kinematics):
    arm = kinematics.arms["right"]
    t = np.linspace(0, 2 * np.pi, 120)
    # The forearm turned well away from 0, where a hinge of the wrist and one of the shoulder come into line.
    angles = np.radians([60.0, 20, 0, 70, 40, 0]) + 0.3 * np.sin(t[:, None] + np.arange(6))
    turn, place = arm.forward(angles)
    found = arm.solve(turn, place, start=np.tile(angles[0], (120, 1)), follow=True)
    np.testing.assert_allclose(found, angles, atol=1e-6)


@given(axis=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1), angle=st.floats(0.0, np.pi))
@settings(max_examples=60, deadline=None)
def test_a_ball_joint_reaches_every_orientation(axis, angle):
    """Three hinges through one point reach any orientation, including half a turn."""
    chain = Chain(axes=np.eye(3), anchors=np.zeros((3, 3)), end=np.zeros(3), ranges=np.tile([-7.0, 7.0], (3, 1)))
    turn = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis)).as_matrix()[None]
    start = Rotation.from_matrix(turn).as_euler("XYZ") + 0.05
    found = chain.solve(turn, np.zeros((1, 3)), start=start)
    assert Rotation.from_matrix(chain.forward(found)[0] @ turn.swapaxes(1, 2)).magnitude().max() < 1e-3
