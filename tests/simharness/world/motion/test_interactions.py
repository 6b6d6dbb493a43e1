"""Properties of every activity of two people, with two adults, and with an adult and a child."""

from dataclasses import dataclass

import numpy as np
import pytest
from casting import foot_vertices, palm_pose, penetration, performer

from simharness.types.random_streams import stream
from simharness.world.motion.activity_registry import activities
from simharness.world.motion.motion import RATE, Performance
from simharness.world.motion.paths import SWAY, Spot
from simharness.world.motion.poses.kinematics import Kinematics

PAIRED = {name: each for name, each in activities().items() if each.performers == 2}
PASSING = ("cross", "swap")  # people walk past each other: test_passing.py
TIME = np.arange(-1.0, 7.0, 1 / RATE)
SPOT = Spot(np.array([0.4, -0.3]), 0.8)
TOUCHING = 0.002  # metres above the floor


@dataclass
class Played:
    name: str
    cast: list[Kinematics]
    performance: Performance


def play(name, cast, *, seed=0, time=TIME):
    return PAIRED[name].perform(cast, SPOT, time, rng=stream(seed, name), pace=1.15)


@pytest.fixture(scope="module", params=[(0, 1, False), (2, 3, True), (1, 0, False)], ids=["adults", "child", "swapped"])
def cast(request):
    first, second, child = request.param
    return [performer(first), performer(second, child=child)]


@pytest.fixture(scope="module", params=list(PAIRED))
def played(request, cast):
    return Played(request.param, cast, play(request.param, cast, seed=len(request.param)))


def test_feet_do_not_skate_or_sink(played):
    for mover, motion in zip(played.cast, played.performance.motions, strict=True):
        feet = foot_vertices(mover)
        skins = np.array([mover.body.skin(pose) for pose in mover.transforms(motion)[::3]])
        assert skins[..., 2].min() > -0.01
        for on_foot in feet.values():
            foot = skins[:, on_foot].astype(float)
            touching = foot[..., 2] < TOUCHING
            both = touching[1:] & touching[:-1]
            moved = np.linalg.norm(np.diff(foot[..., :2], axis=0), axis=-1)
            slid = np.where(both, moved, 0.0).sum(axis=1) / np.maximum(both.sum(axis=1), 1)
            planted = both.any(axis=1)
            stances = np.split(slid, np.flatnonzero(np.diff(planted.astype(int)) != 0) + 1)
            assert max(stance.sum() for stance in stances) < 0.02


def test_joints_keep_their_limits_and_do_not_jump(played):
    for mover, motion in zip(played.cast, played.performance.motions, strict=True):
        low, high = mover.ranges.T
        assert (motion.angles >= low - 1e-9).all()
        assert (motion.angles <= high + 1e-9).all()
        joints = mover.joints(motion)
        velocity = np.diff(joints, axis=0) * RATE
        assert np.linalg.norm(velocity, axis=-1).max() < (6.0 if played.name in PASSING else 3.5)
        assert np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max() * RATE < 60.0


def test_penetration_is_small(played):
    depth = penetration(played.cast, played.performance.motions, TIME[::4])
    assert depth.max() < 0.05


def test_pelvises_keep_within_the_clearance(played):
    for motion in played.performance.motions:
        off = np.linalg.norm(motion.root[:, :2] - SPOT.place, axis=1)
        assert off.max() < PAIRED[played.name].clearance + SWAY


def test_first_and_second_face_each_other_along_the_bearing(played):
    if played.name in PASSING:
        return
    first, second = (motion.root[:, :2] for motion in played.performance.motions)
    way = second - first
    along = way @ [np.cos(SPOT.bearing), np.sin(SPOT.bearing)]
    assert along.min() > 0.25
    across = way @ [-np.sin(SPOT.bearing), np.cos(SPOT.bearing)]
    assert np.degrees(np.arctan2(np.abs(across), along)).max() < 25


def test_a_frame_does_not_depend_on_the_duration(played):
    short = play(played.name, played.cast, seed=len(played.name), time=TIME[:120])
    for one, other in zip(short.motions, played.performance.motions, strict=True):
        np.testing.assert_allclose(one.angles, other.angles[:120], atol=1e-9)
        np.testing.assert_allclose(one.root, other.root[:120], atol=1e-9)
    for one, other in zip(short.props, played.performance.props, strict=True):
        np.testing.assert_allclose(one.trajectory.at(TIME[:120]), other.trajectory.at(TIME[:120]), atol=1e-9)


def test_props_do_not_jump(played):
    for prop in played.performance.props:
        pose = prop.trajectory.at(TIME)
        velocity = np.diff(pose[:, :3], axis=0) * RATE
        assert np.linalg.norm(velocity, axis=1).max() < 2.0
        assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() * RATE < 20.0


def palms(mover, motion, side):
    return palm_pose(mover, motion, side)[1]


def runs(on):
    """Return the lengths of the runs of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(int), [0]])))
    return edges[1::2] - edges[::2]


@pytest.mark.parametrize("seed", range(3))
def test_hands_meet_and_shake(cast, seed):
    motions = play("shake_hands", cast, seed=seed).motions
    first, second = (palms(mover, motion, "right") for mover, motion in zip(cast, motions, strict=True))
    met = np.linalg.norm(first - second, axis=1) < 0.03
    assert runs(met).max() > 1.2 * RATE  # held for over a second
    assert np.linalg.norm(first - second, axis=1).max() > 0.25  # and let go
    longest = np.argmax(runs(met))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], met.astype(int), [0]])))
    height = first[edges[2 * longest] : edges[2 * longest + 1], 2]
    assert np.ptp(height) > 0.01
    assert np.count_nonzero(np.diff(np.sign(np.diff(height)))) >= 3  # up and down and up again


@pytest.mark.parametrize("seed", range(2))
def test_hug_closes_both_pairs_of_arms(cast, seed):
    motions = play("hug", cast, seed=seed).motions
    away = np.linalg.norm(motions[0].root[:, :2] - motions[1].root[:, :2], axis=1)
    assert away.max() - away.min() > 0.15  # they step up to each other
    held = away < away.min() + 0.01
    for k in (0, 1):
        mover, other = cast[k], motions[1 - k]
        behind = np.stack([palms(mover, motions[k], side) for side in ("left", "right")])[:, held]
        way = other.root[held, :2] - motions[k].root[held, :2]
        beyond = ((behind[..., :2] - motions[k].root[held, :2]) * way).sum(-1) / (way**2).sum(-1)
        assert np.sort(beyond, axis=1)[:, -20:].min() > 0.85  # the palms are at the other's back or flank


@pytest.mark.parametrize("seed", range(4))
def test_the_object_is_always_in_a_hand(cast, seed):
    made = play("hand_over", cast, seed=seed)
    (prop,) = made.props
    middle = prop.trajectory.at(TIME)[:, :3]
    near = []
    for mover, motion in zip(cast, made.motions, strict=True):
        hand = palms(mover, motion, "right") - middle
        distance = np.linalg.norm(hand, axis=1)
        near.append(distance < np.linalg.norm(prop.size))
        steady = np.linalg.norm(hand - np.median(hand[near[-1]], axis=0), axis=1) < 0.012
        near[-1] &= steady
    assert (near[0] | near[1]).mean() > 0.97  # each hand stays where it grips while it holds
    assert 0.1 < near[0].mean() < 0.95
    assert 0.1 < near[1].mean() < 0.95
    assert (near[0] & near[1]).any()  # both at the hand-over


@pytest.mark.parametrize("seed", range(4))
def test_hands_are_on_the_table_and_not_in_it(cast, seed):
    made = play("table", cast, seed=seed)
    (top,) = (prop for prop in made.props if prop.kind == "table")
    for mover, motion in zip(cast, made.motions, strict=True):
        for side in ("left", "right"):
            over = palms(mover, motion, side)[:, 2] - top.size[2]
            assert over.min() > -0.005
            assert over.max() < 0.35
    chairs = [prop for prop in made.props if prop.kind == "chair"]
    assert len(chairs) in (0, 2)
    for prop, mover, motion in zip(chairs, cast, made.motions, strict=False):
        skin = np.array([mover.body.skin(pose) for pose in mover.transforms(motion)[::60]])
        pose = prop.trajectory.pose[0]
        seat = np.linalg.norm(skin[..., :2] - pose[:2], axis=-1) < 0.15
        over = np.where(seat, skin[..., 2], np.inf).min(axis=1) - prop.size[2]
        assert (np.abs(over) < 0.03).all()  # sits on it


@pytest.mark.slow
def test_motions_differ_between_seeds(cast):
    for name in PAIRED:
        one, again, other = (play(name, cast, seed=seed, time=TIME[:60]).motions[0].angles for seed in (1, 1, 2))
        np.testing.assert_array_equal(one, again)
        assert np.abs(one - other).max() > 0.02
