import numpy as np
import pytest
from casting import palm_pose
from scipy.spatial.transform import Rotation

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import ARM, DOFS, LEG
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import (
    Footprint,
    foot_path,
    hip_position,
    pelvis_from_hips,
    spot_to_world,
    stance,
)
from simharness.world.motion.poses.inverse_kinematics import arm_angles, reach_with, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import ease

TIME = np.arange(0.0, 2.0, 1 / 30)
SPOT = Spot(np.array([0.4, 1.2]), 2.1)


@pytest.fixture(scope="module", params=[0, 5])
def kinematics(request):
    return Kinematics(make_body(draw_shape(stream(request.param, "posing"))))


@pytest.fixture(scope="module")
def standing(kinematics):
    return gesture("stand", kinematics, SPOT, TIME, rng=stream(1, "stand"))


def test_the_palm_lies_on_the_skin_in_any_pose(kinematics, standing):
    for name in ("left", "right"):
        _, place = palm_pose(kinematics, standing, name)
        for pose, point in zip(kinematics.transforms(standing)[::20], place[::20], strict=True):
            assert np.linalg.norm(kinematics.body.skin(pose) - point, axis=1).min() < 0.012


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hand_reaches_its_target_position(kinematics, standing, side):
    sign = 1.0 if side == "left" else -1.0
    chest = kinematics.standing_height + kinematics.arms[side].anchors[0, 2]
    length = np.linalg.norm(kinematics.arms[side].end - kinematics.arms[side].anchors[0])
    way = np.stack([0.6 * length + 0.1 * np.sin(TIME), sign * 0.1 + 0 * TIME, chest - 0.3 * length + 0 * TIME], axis=-1)
    place = spot_to_world(SPOT, way)
    guess = arm_angles(kinematics, shoulder_flexion=50.0, elbow_flexion=50.0)
    weight = np.clip(TIME - 0.5, 0, 1)
    moved = reach_with(kinematics, standing, side, place, weight=weight, guess=guess)
    _, got = palm_pose(kinematics, moved, side)
    assert np.linalg.norm(got - place, axis=1)[weight == 1].max() < 0.003
    np.testing.assert_array_equal(moved.angles[weight == 0], standing.angles[weight == 0])
    others = np.delete(np.arange(len(DOFS)), [DOFS.index(f"{side}_{name}") for name in ARM])
    np.testing.assert_array_equal(moved.angles[:, others], standing.angles[:, others])
    assert np.abs(np.diff(moved.angles, axis=0)).max() < 0.2


def test_a_hand_reaches_its_target_orientation(kinematics, standing):
    guess = arm_angles(kinematics, shoulder_flexion=30.0, elbow_flexion=80.0)
    angles = standing.angles.copy()
    angles[:, [DOFS.index(f"right_{name}") for name in ARM]] = guess + np.radians([5.0, 3, -4, 6, 10, 8])
    wanted = type(standing)(standing.time, standing.root, angles)
    turn, place = palm_pose(kinematics, wanted, "right")
    moved = reach_with(kinematics, standing, "right", place, turn=turn, guess=guess)
    got_turn, got = palm_pose(kinematics, moved, "right")
    assert np.linalg.norm(got - place, axis=1).max() < 0.002
    assert Rotation.from_matrix(got_turn.swapaxes(1, 2) @ turn).magnitude().max() < np.radians(6)


def test_a_target_out_of_reach_is_approached_smoothly(kinematics, standing):
    shoulder = kinematics.standing_height + kinematics.arms["left"].anchors[0, 2]
    ahead = 0.2 + 2.0 * ease(TIME / 2.0)  # metres: from well within reach to far out of it
    far = np.stack([ahead, 0.2 + 0 * TIME, shoulder + 0 * TIME], axis=-1)
    guess = arm_angles(kinematics, shoulder_flexion=80.0, elbow_flexion=40.0)
    moved = reach_with(kinematics, standing, "left", spot_to_world(SPOT, far), guess=guess)
    velocity = np.diff(moved.angles, axis=0) * 30
    assert (
        np.abs(velocity).max() < 14.0
    )  # rad/s for a hand at 2 m/s; the elbow opens fastest, just before the arm is straight
    elbow = moved.angles[:, DOFS.index("left_elbow_flexion")]
    assert np.degrees(elbow[-1]) < 25
    assert (elbow > 0).all()


def test_arm_angles_refuse_unknown_hinges(kinematics):
    with pytest.raises(ValueError, match=r"an arm has no hinge knee_flexion; its hinges are shoulder_flexion"):
        arm_angles(kinematics, knee_flexion=3.0)


def test_hip_position_agrees_with_the_kinematics(kinematics):
    """Compare the closed form with the solved and posed body."""
    shank, thigh = np.radians([3.0, 12.0, 20.0]), np.radians([5.0, 40.0, 75.0])
    prints = {side: Footprint((0.0, float(kinematics.legs[side].anchors[0, 1]))) for side in ("left", "right")}
    hip = hip_position(kinematics, shank=shank, thigh=thigh)
    lean = np.radians([2.0, 20.0, 30.0])
    pelvis, height = pelvis_from_hips(kinematics, SPOT, hip, lean=lean)
    feet = {side: foot_path(kinematics, SPOT, np.zeros(3), prints[side]) for side in prints}
    motion = solve_legs(kinematics, np.arange(3.0), pelvis, height, feet, {})
    for side in prints:
        column = {name: np.degrees(motion.angles[:, DOFS.index(f"{side}_{name}")]) for name in LEG}
        np.testing.assert_allclose(column["knee_flexion"], np.degrees(shank + thigh), atol=0.5)
        np.testing.assert_allclose(column["hip_flexion"], np.degrees(thigh + lean), atol=0.5)
        np.testing.assert_allclose(column["ankle_dorsiflexion"], np.degrees(shank), atol=0.5)


def test_a_foot_steps_from_footprint_to_footprint(kinematics):
    first = stance(kinematics, "left")
    up = first.moved(0.3, 0.1, floor=0.2)
    time = np.linspace(0.0, 3.0, 301)
    foot = foot_path(kinematics, SPOT, time, first, [(1.0, 1.6, up), (2.0, 2.6, first)], lift=0.05)
    flat = kinematics.rolling.at(np.zeros(1))[1][0]
    np.testing.assert_allclose(foot.ankle[0], spot_to_world(SPOT, [*first.place, flat]), atol=1e-6)
    np.testing.assert_allclose(foot.ankle[180], spot_to_world(SPOT, [*up.place, flat + 0.2]), atol=1e-6)
    np.testing.assert_allclose(foot.ankle[-1], foot.ankle[0], atol=1e-6)
    assert foot.ankle[:, 2].max() > flat + 0.22
    # A planted foot may roll, but its sole stays where it is: what rolls is not dragged.
    sole = kinematics.soles["left"]
    points = foot.ankle[:, None] + np.einsum("tij,nj->tni", foot.turn, sole)
    assert points[..., 2].min() > -1e-4
    heel = points[:101, sole[:, 0].argmax()]  # the foremost point, while the heel rises
    assert np.linalg.norm(np.diff(heel[:, :2], axis=0), axis=1).sum() < 0.01
