"""Properties of walking, measured on skin and joints of several bodies on several loops."""

from dataclasses import dataclass

import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activities.gait import WALK, make_gait
from simharness.world.motion.activities.round_loops import walk
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import SWAY, Loop, make_loop
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.track_planning import LoopRequest, plan_tracks

RATE = 80.0  # Hz
TIME = np.arange(0.0, 3.2, 1 / RATE)
TOUCHING = 0.0015  # metres above the floor


@dataclass
class Walk:
    kinematics: Kinematics
    loop: Loop
    motion: Motion
    feet: dict[str, np.ndarray]  # (T, n, 3) skin of the feet
    lowest: np.ndarray  # (T,) of all skin


@pytest.fixture(scope="module", params=range(5))
def walked(request) -> Walk:
    seed = request.param
    kinematics = Kinematics(make_body(draw_shape(stream(seed, "walk"))))
    speed = [0.75, 0.85, 0.95, 1.05, 1.15][seed]
    (loop,) = plan_tracks(seed, [LoopRequest("walk", speed, speed, speed)], area=2.0, spacing=0.8, span=(0.0, 4.0))
    assert isinstance(loop, Loop)
    motion = walk(kinematics, loop, TIME, rng=stream(seed, "manner"), pace=1.1)
    body = kinematics.body
    skins = np.array([body.skin(transforms) for transforms in kinematics.transforms(motion)])
    most = body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(axis=1)]
    feet = {
        side: skins[:, np.isin(most, [body.index(f"{side}Foot"), body.index(f"{side}ToeBase")])].astype(float)
        for side in ("Left", "Right")
    }
    return Walk(kinematics, loop, motion, feet, skins[..., 2].min(axis=1))


def test_feet_neither_sink_nor_float(walked):
    assert walked.lowest.min() > -0.01
    assert walked.lowest.max() < 0.01


def test_stance_feet_do_not_slide(walked):
    for foot in walked.feet.values():
        touching = foot[..., 2] < TOUCHING
        both = touching[1:] & touching[:-1]
        moved = np.linalg.norm(np.diff(foot[..., :2], axis=0), axis=-1)
        slid = np.where(both, moved, 0.0).sum(axis=1) / np.maximum(both.sum(axis=1), 1)
        planted = both.any(axis=1)
        assert 0.5 < planted.mean() < 0.75  # a stance lasts 60 % of a stride
        stances = np.split(slid, np.flatnonzero(np.diff(planted.astype(int)) != 0) + 1)
        assert len(stances) >= 3
        assert max(stance.sum() for stance in stances) < 0.02


def test_always_a_foot_on_the_floor_and_sometimes_both(walked):
    down = np.stack([(foot[..., 2] < TOUCHING).any(axis=1) for foot in walked.feet.values()])
    assert down.any(axis=0).all()
    assert 0.1 < down.all(axis=0).mean() < 0.4


def test_joints_keep_their_limits(walked):
    low, high = walked.kinematics.ranges.T
    assert (walked.motion.angles >= low - 1e-9).all()
    assert (walked.motion.angles <= high + 1e-9).all()


def test_velocities_are_human_and_do_not_jump(walked):
    """Knees swing at 300 to 450 degrees / s (Winter 1991); sampled more finely, a smooth curve's steps get smaller."""
    fine = np.arange(0.0, 1.2, 1 / 640)
    motion = walk(walked.kinematics, walked.loop, fine, rng=stream(3, "fine"), pace=1.1)
    velocity = np.degrees(np.diff(motion.angles, axis=0)) * 640
    assert np.abs(velocity).max() < 500
    assert np.abs(np.diff(velocity, axis=0)).max() < 160  # an impact: heel strike
    root = np.diff(motion.root[:, :3], axis=0) * 640
    assert np.abs(np.diff(root, axis=0)).max() < 0.02  # m/s


def test_pelvis_follows_the_loop(walked):
    off = walked.motion.root[:, :2] - walked.loop.position(TIME)
    assert np.linalg.norm(off, axis=1).max() < SWAY
    assert 0.01 < np.ptp(walked.motion.root[:, 2]) < 0.06  # 2 to 5 cm, Winter 1991


def test_legs_look_like_the_normative_ones(walked):
    angles = np.degrees(walked.motion.angles)
    for side in ("left", "right"):
        knee = angles[:, DOFS.index(f"{side}_knee_flexion")]
        hip = angles[:, DOFS.index(f"{side}_hip_flexion")]
        assert 45 < knee.max() < 75
        assert knee.min() < 20  # the inner leg of a bend stays bent a little
        assert 25 < np.ptp(hip) < 55
        assert hip.min() < 0


def test_arms_swing_against_the_legs(walked):
    for side in ("left", "right"):
        arm = walked.motion.angles[:, DOFS.index(f"{side}_shoulder_flexion")]
        leg = walked.motion.angles[:, DOFS.index(f"{side}_hip_flexion")]
        assert np.corrcoef(arm, leg)[0, 1] < -0.5


@pytest.mark.slow
def test_a_straight_walk_is_close_to_the_curves():
    kinematics = Kinematics(make_body(draw_shape(stream(9, "walk"))))
    gait = make_gait(kinematics, speed=1.2)
    around = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    loop = make_loop(60 * np.stack([np.cos(around), np.sin(around)], axis=-1), speed=1.2, start=0.0)
    motion = walk(kinematics, loop, TIME, rng=stream(9, "manner"))
    columns = [DOFS.index(f"left_{name}") for name in ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")]
    got = motion.angles[:, columns]
    phase = np.linspace(0, 1, 200, endpoint=False)
    fits = [gait.vigour * WALK.angles(shift + gait.frequency * TIME) for shift in phase]
    best = min(fits, key=lambda fit: np.abs(fit - got).sum())
    assert [np.corrcoef(best[:, k], got[:, k])[0, 1] > low for k, low in enumerate((0.9, 0.85, 0.6))] == [True] * 3
    assert np.degrees(np.sqrt(np.mean((best - got) ** 2))) < 13


def test_manner_is_drawn_from_the_stream(walked):
    again = walk(walked.kinematics, walked.loop, TIME[:9], rng=stream(4, "x"))
    same = walk(walked.kinematics, walked.loop, TIME[:9], rng=stream(4, "x"))
    other = walk(walked.kinematics, walked.loop, TIME[:9], rng=stream(5, "x"))
    np.testing.assert_array_equal(again.angles, same.angles)
    assert np.abs(again.angles - other.angles).max() > 0.05
