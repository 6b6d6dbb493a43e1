"""People on routes, who start, stop and turn on the spot: height of the pelvis, range of the joints, feet."""

from __future__ import annotations

import numpy as np
import pytest
from casting import performer

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.motion.activities.gait import make_gait, similar_walk_ratio
from simharness.world.motion.activities.route_walking import following_height, walk_route
from simharness.world.motion.paths import Itinerary
from simharness.world.motion.poses.inverse_kinematics import (
    Foot,
    Pelvis,
    dorsiflexion,
    follow_shank,
    pelvis_height,
    solve_legs,
)

TIME = np.arange(-0.5, 11.0, 1 / 60)
BENT = np.radians(6.0)
SIDES = ("left", "right")


def route_of(mover, froude=0.33):
    speed = froude * np.sqrt(9.81 * mover.leg_length)
    there = Itinerary([0.0, 0.0], 0.3, speed, 0.5).walk(2.0).turn(0.3 + np.pi, sense=1.0).stand(0.5)
    return there.walk(0.4).turn(2.0).walk(1.5).route()


@pytest.fixture(scope="module", params=[(2, False), (3, True)], ids=["adult", "child"])
def mover(request):
    return performer(request.param[0], child=request.param[1])


def walked(mover, *, time=TIME, seed=0, froude=0.33):
    return walk_route(mover, route_of(mover, froude), time, rng=stream(seed, "route"), pace=1.1)


@pytest.mark.parametrize("seed", range(3))
def test_no_joint_of_a_leg_reaches_the_end_of_its_range(mover, seed):
    motion = walked(mover, seed=seed)
    legs = [k for k, name in enumerate(DOFS) if any(part in name for part in ("hip", "knee", "ankle"))]
    low, high = mover.ranges[legs].T
    spare = np.minimum(motion.angles[:, legs] - low, high - motion.angles[:, legs])
    assert spare.min() > 1e-6


def test_people_who_stand_stand_upright(mover):
    motion = walked(mover)
    route = route_of(mover)
    stands = (TIME < 0.0) | (route.span[1] + 1.5 < TIME)
    assert stands.sum() > 30
    assert motion.root[stands, 2].min() > 0.98 * mover.standing_height
    strides = np.linalg.norm(route.velocity(TIME), axis=1) > 0.99 * route.speed
    assert motion.root[strides, 2].max() < motion.root[stands, 2].max()


def test_a_walk_does_not_depend_on_the_times_that_are_asked_for(mover):
    whole, part = walked(mover), walked(mover, time=TIME[200:260])
    np.testing.assert_allclose(part.root, whole.root[200:260], atol=1e-9)
    np.testing.assert_allclose(part.angles, whole.angles[200:260], atol=1e-9)


def test_the_pelvis_is_never_higher_than_legs_allow_and_level_over_equal_steps():
    mover = performer(2)
    leg = mover.legs["left"].end

    def stances(time):
        apart = 0.2 + 0.15 * np.sin(5.0 * time) + np.where(time > 6.0, 0.1 * np.sin(12.0 * (time - 6.0)), 0.0)
        feet = {
            side: Foot(
                np.column_stack([sign * apart, np.full(len(time), sign * leg[1]), np.full(len(time), 0.08)]),
                np.zeros(len(time)),
                np.zeros(len(time)),
            )
            for side, sign in zip(SIDES, (1.0, -1.0), strict=True)
        }
        still = np.zeros(len(time))
        return Pelvis(np.zeros((len(time), 2)), 0.01 * np.sin(3.0 * time), still, still, still), feet

    time = np.arange(0.0, 12.0, 0.01)
    height = following_height(mover, stances, time, straightest=BENT, within=0.7)
    pelvis, feet = stances(time)
    turn = pelvis.turn.as_matrix()
    allowed = np.min(
        [pelvis_height(mover, side, pelvis.ground, turn, feet[side].ankle, BENT) for side in SIDES], axis=0
    )
    assert (height + pelvis.bob <= allowed + 1e-3).all()  # the legs are sampled every 0.04 s
    assert (height + pelvis.bob > allowed - 0.15).all()

    def level(time):
        pelvis, feet = stances(np.mod(time, 2 * np.pi / 5.0))
        return Pelvis(pelvis.ground, np.zeros(len(time)), pelvis.bearing, pelvis.lean, pelvis.list), feet

    steady = following_height(mover, level, time, straightest=BENT, within=0.7)
    assert np.ptp(steady) < 1e-3  # sampled; the lowest height comes once in 1.26 s, less than twice 0.7 s


def test_dorsiflexion_is_that_of_the_solved_leg_and_the_heel_rises_only_near_the_end_of_the_range(mover):
    height = 0.93 * mover.standing_height
    hip = mover.legs["left"].anchors[0]
    x = np.linspace(-0.25, 0.3, 60) * mover.leg_length
    rolling, still = mover.rolling, np.zeros(60)

    def foot(pitch):
        ahead, high = rolling.at(pitch)
        return Foot(np.column_stack([ahead - x, np.full(60, mover.legs["left"].end[1]), high]), still, pitch)

    pelvis = Pelvis(np.zeros((60, 2)), still, still, still, still)

    def solved(pitch):
        motion = solve_legs(mover, np.arange(60.0), pelvis, height, {side: foot(pitch) for side in SIDES}, {})
        return motion.angles[:, DOFS.index("left_ankle_dorsiflexion")]

    hips = np.tile(hip + [0.0, 0.0, height], (60, 1))
    flat = dorsiflexion(mover, hips, foot(still))
    highest = mover.ranges[DOFS.index("left_ankle_dorsiflexion"), 1]
    free = flat < highest - np.radians(1.0)
    assert 10 < free.sum() < 50
    np.testing.assert_allclose(solved(still)[free], flat[free], atol=np.radians(1.5))
    pitch = follow_shank(mover, "left", pelvis, np.full(60, height), still, foot)
    assert (pitch <= 0.0).all()
    np.testing.assert_array_equal(pitch[flat < highest - np.radians(5.0)], 0.0)
    assert (pitch[~free] < -np.radians(2.0)).all()
    assert (solved(pitch) < highest - 1e-6).mean() > (solved(still) < highest - 1e-6).mean()


def test_children_take_steps_in_proportion_to_their_legs():
    """A child of seven walks at 1.14 m/s with 143 steps a minute of 0.48 m: Sutherland et al., 1980."""
    assert similar_walk_ratio(0.57) == pytest.approx(0.479 / 143.5, rel=0.15)
    strides = []
    for mover in (performer(2), performer(3, child=True)):
        speed = 0.33 * np.sqrt(9.81 * mover.leg_length)
        gait = make_gait(mover, speed=speed, walk_ratio=similar_walk_ratio(mover.leg_length))
        strides.append(gait.stride / mover.leg_length)
    assert strides[0] == pytest.approx(strides[1], rel=1e-6)
