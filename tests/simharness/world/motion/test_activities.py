"""Properties of every activity of one person, measured on skin and joints of several bodies."""

from dataclasses import dataclass
from typing import get_args

import numpy as np
import pytest

from simharness.scenario.sections.people_section import ActivityName
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activity_registry import activities, solo_activity
from simharness.world.motion.motion import Motion, Performance, motion_clock
from simharness.world.motion.paths import SWAY, Itinerary, Loop, Route, Spot, make_loop
from simharness.world.motion.poses.kinematics import Kinematics

SOLO = {name: each for name, each in activities().items() if each.performers == 1}
TIME = motion_clock(8.0, margin=1.0)
RATE = 60.0
FASTEST = {"walk": 6.0, "run": 10.0}  # m/s, of any joint; of others 6
HARDEST = {"run": 160.0}  # m/s², of any joint; of others 60
TOUCHING = 0.0015  # metres above the floor, or over the block of "step"


@dataclass
class Done:
    name: str
    kinematics: Kinematics
    track: Loop | Spot | Route
    performance: Performance
    joints: np.ndarray  # (T, 17, 3)
    skins: np.ndarray  # (T / 3, n, 3), every third instant

    @property
    def motion(self) -> Motion:
        return self.performance.motions[0]


def some_track(name: str, kinematics: Kinematics) -> Loop | Spot | Route:
    if SOLO[name].track is Spot:
        return Spot(np.array([0.6, -0.4]), 0.9)
    if SOLO[name].track is Route:
        speed = 0.33 * np.sqrt(9.81 * kinematics.leg_length)
        walker = Itinerary(np.array([-1.0, 0.5]), 0.4, speed, -0.5).walk(2.0).turn(3.0).stand(0.4).walk(0.7)
        return walker.turn(0.4 + np.pi, sense=-1).walk_to([1.5, -1.0]).route()
    around = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    egg = np.stack([1.7 * np.cos(around), (1.3 + 0.2 * np.cos(around)) * np.sin(around)], axis=-1)
    return make_loop(egg, speed=np.mean(SOLO[name].froude) * np.sqrt(9.81 * kinematics.leg_length), start=0.3)


def perform(name: str, kinematics: Kinematics, time: np.ndarray, *, seed: int) -> Performance:
    track = some_track(name, kinematics)
    return SOLO[name].perform([kinematics], track, time, rng=stream(seed, name), pace=1.1)


@pytest.fixture(scope="module")
def bodies() -> list[Kinematics]:
    """Return a woman, a man, and a small woman."""
    drawn = [make_body(draw_shape(stream(seed, "singles"))) for seed in range(12)]
    women = [body for body in drawn if body.shape.gender > 0.5]
    men = [body for body in drawn if body.shape.gender < 0.5]
    return [Kinematics(body) for body in (women[0], men[0], min(women, key=lambda body: body.stature))]


@pytest.fixture(scope="module", params=[(name, k) for name in SOLO for k in range(3)], ids=lambda p: f"{p[0]}-{p[1]}")
def done(request, bodies) -> Done:
    name, k = request.param
    kinematics = bodies[k]
    performance = perform(name, kinematics, TIME, seed=k)
    transforms = kinematics.transforms(performance.motions[0])
    skins = np.array([kinematics.body.skin(pose) for pose in transforms[::3]])
    joints = kinematics.body.joints(transforms)
    return Done(name, kinematics, some_track(name, kinematics), performance, joints, skins)


def test_every_name_of_the_scenario_is_registered():
    assert tuple(activities()) == tuple(name for name in get_args(ActivityName) if name != "mocap")


def test_a_name_is_registered_once():
    with pytest.raises(ValueError, match=r"'walk' is registered twice"):
        solo_activity("walk")(lambda *performer: None)


def test_joints_keep_their_limits(done):
    low, high = done.kinematics.ranges.T
    assert (done.motion.angles >= low - 1e-9).all()
    assert (done.motion.angles <= high + 1e-9).all()


def test_nothing_sinks_into_the_floor(done):
    lowest = done.skins[..., 2].min(axis=1)
    assert lowest.min() > -0.01
    if done.name not in ("run", "step"):
        assert lowest.max() < 0.005  # without running, some skin always touches the floor


def test_stance_feet_do_not_slide(done):
    body = done.kinematics.body
    most = body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(axis=1)]
    blocks = [prop.size[2] for prop in done.performance.props if prop.kind == "step"]
    for side in ("Left", "Right"):
        on_foot = np.isin(most, [body.index(f"{side}Foot"), body.index(f"{side}ToeBase")])
        foot = done.skins[:, on_foot].astype(float)
        touching = np.any([np.abs(foot[..., 2] - level) < TOUCHING for level in (0.0, *blocks)], axis=0)
        if done.name == "lie":
            touching &= foot[..., 2].min(axis=1, keepdims=True) + 0.1 > foot[..., 2].max(axis=1, keepdims=True)
        both = touching[1:] & touching[:-1]
        moved = np.linalg.norm(np.diff(foot[..., :2], axis=0), axis=-1)
        slid = np.where(both, moved, 0.0).sum(axis=1) / np.maximum(both.sum(axis=1), 1)
        stances = np.split(slid, np.flatnonzero(np.diff(both.any(axis=1).astype(int)) != 0) + 1)
        assert max(stance.sum() for stance in stances) < 0.02


def test_speeds_are_human_and_do_not_jump(done):
    velocity = np.diff(done.joints, axis=0) * RATE
    assert np.linalg.norm(velocity, axis=-1).max() < FASTEST.get(done.name, 6.0)
    acceleration = np.diff(velocity, axis=0) * RATE
    assert np.linalg.norm(acceleration, axis=-1).max() < HARDEST.get(done.name, 60.0)


def test_joints_move(done):
    moved = np.linalg.norm(done.joints - done.joints[0], axis=-1).max()
    assert moved > {"stand": 0.03, "crouch": 0.1}.get(done.name, 0.2)


def test_pelvis_stays_within_the_clearance(done):
    off = np.linalg.norm(done.motion.root[:, :2] - done.track.position(TIME), axis=1)
    assert off.max() < SOLO[done.name].clearance + SWAY
    reach = np.linalg.norm(done.joints[..., :2] - done.track.position(TIME)[:, None], axis=-1).max()
    assert reach < SOLO[done.name].clearance + 0.5 * done.kinematics.body.stature  # an arm and a shoulder


def test_a_frame_does_not_depend_on_the_duration(done):
    short = perform(done.name, done.kinematics, TIME[:150], seed=done_seed(done))
    np.testing.assert_allclose(short.motions[0].root, done.motion.root[:150], atol=1e-9)
    np.testing.assert_allclose(short.motions[0].angles, done.motion.angles[:150], atol=1e-7)
    for prop, same in zip(short.props, done.performance.props, strict=True):
        assert prop.size == same.size
        np.testing.assert_allclose(prop.trajectory.at(TIME[:150]), same.trajectory.at(TIME[:150]), atol=1e-9)


def done_seed(done: Done) -> int:
    """Return the seed that gives the same performance."""
    for seed in range(3):
        again = perform(done.name, done.kinematics, TIME[:3], seed=seed)
        if np.allclose(again.motions[0].angles, done.motion.angles[:3], atol=1e-6):
            return seed
    raise AssertionError(f"{done.name} is not the same again")


def test_manner_is_drawn_from_the_stream(done):
    seed = done_seed(done)
    other = perform(done.name, done.kinematics, TIME[:30], seed=seed + 10)
    assert np.abs(other.motions[0].angles - done.motion.angles[:30]).max() > 0.005


def test_props_move_continuously(done):
    for prop in done.performance.props:
        pose = prop.trajectory.at(TIME)
        velocity = np.diff(pose[:, :3], axis=0) * RATE
        assert np.linalg.norm(velocity, axis=1).max(initial=0.0) < 3.0
        assert np.abs(np.diff(velocity, axis=0)).max(initial=0.0) * RATE < 40.0
        assert pose[:, 2].min() > -1e-6
