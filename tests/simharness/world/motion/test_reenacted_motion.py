"""Re-enactment of simulated people from their own COCO-17 joints: places, poses, facing directions and body sizes."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest
from casting import foot_vertices, performer
from scipy.spatial.transform import Rotation

from mvpose.formats.people import write_people
from mvpose.recording import People
from mvpose.skeleton import COCO17
from simharness.scenario.sections.scenario import Scenario
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activity_registry import activities
from simharness.world.motion.choreography import choreograph
from simharness.world.motion.mocap import recorded_shape, reenact
from simharness.world.motion.mocap.recorded_people import body_lengths
from simharness.world.motion.mocap.reenactment import middle
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Loop, Spot, make_loop
from simharness.world.motion.poses.kinematics import Kinematics

pytestmark = pytest.mark.slow

ACTIVITIES = ("walk", "reach", "squat", "turn", "talk", "dance")
RATE, DURATION = 25.0, 3.0
TIME = np.arange(0.0, DURATION, 1 / RATE)
LIMBS = [COCO17.index(f"{side}_{name}") for side in ("left", "right")
         for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")]  # fmt: skip
_ROUND = np.linspace(0.0, 2 * np.pi, 200, endpoint=False)
TRACKS = [make_loop(np.stack([2.0 * np.cos(_ROUND), 1.5 * np.sin(_ROUND)], axis=1), speed=1.2, start=0.1)]
TRACKS += [Spot(np.array([0.8 * k - 2.0, 0.5]), 1.1 * k) for k in range(1, len(ACTIVITIES))]


@dataclass(frozen=True)
class Recorded:
    """Simulated recording, and the same people re-enacted by other bodies."""

    tracks: People
    originals: list[Motion]
    cast: list[Kinematics]
    motions: list[Motion]

    @property
    def joints(self) -> np.ndarray:
        """Joints of the re-enactment at the recorded times, (T, P, 17, 3)."""
        pairs = zip(self.cast, self.motions, strict=True)
        return np.stack([mover.joints(motion) for mover, motion in pairs], axis=1)


def people_at(rate: float, joints: np.ndarray) -> People:
    return People(np.arange(len(joints)) / rate, np.arange(joints.shape[1]), joints)


def record(name: str, k: int, rate: float = RATE) -> tuple[Motion, np.ndarray]:
    activity, time = activities()[name], np.arange(0.0, DURATION, 1 / rate)
    assert (activity.track is Loop) == isinstance(TRACKS[k], Loop)
    motion = activity.perform([performer(k)], TRACKS[k], time, rng=stream(k, "recording"), pace=1.1).motions[0]
    return motion, performer(k).joints(motion)


@pytest.fixture(scope="module")
def recorded() -> Recorded:
    originals, joints = zip(*(record(name, k) for k, name in enumerate(ACTIVITIES)), strict=True)
    tracks = people_at(RATE, np.stack(joints, axis=1))
    shapes = [recorded_shape(draw_shape(stream(70 + k, "other")), tracks, k) for k in range(len(tracks))]
    cast = [Kinematics(make_body(shape)) for shape in shapes]
    motions = [reenact(tracks, k, mover, time=TIME) for k, mover in enumerate(cast)]
    return Recorded(tracks, list(originals), cast, motions)


def facing(root: np.ndarray) -> np.ndarray:
    forward = Rotation.from_quat(root[:, 3:], scalar_first=True).apply([1.0, 0.0, 0.0])
    return np.arctan2(forward[:, 1], forward[:, 0])


def test_limbs_are_where_they_were(recorded):
    off = np.linalg.norm(recorded.joints - recorded.tracks.joints, axis=-1)[..., LIMBS]
    assert np.median(off, axis=(0, 2)).max() < 0.02  # each person
    assert np.median(off, axis=(0, 1)).max() < 0.018  # each joint
    assert off.max() < 0.1


@pytest.mark.slow
def test_limbs_are_nearer_than_noisy_tracks(recorded):
    """Errors of 15 mm along each axis put joints 26 mm off; the height of the floor is unknown."""
    noise = stream(0, "noise").normal(0.0, 0.015, recorded.tracks.joints.shape)
    noisy = people_at(RATE, recorded.tracks.joints + noise)
    for person, mover in enumerate(recorded.cast):
        off = mover.joints(reenact(noisy, person, mover, time=TIME)) - recorded.tracks.joints[:, person]
        off = off[:, LIMBS] - off[:, LIMBS].mean(axis=(0, 1)) * [0.0, 0.0, 1.0]
        assert np.sqrt((off**2).sum(axis=-1).mean()) < 0.022
        assert np.sqrt((off**2).sum(axis=-1).mean(axis=0)).max() < 0.035


def test_nobody_is_away_from_the_recorded_place(recorded):
    off = middle(recorded.joints, "hip") - middle(recorded.tracks.joints, "hip")
    assert np.linalg.norm(off[..., :2], axis=-1).max() < 0.01
    assert np.abs(np.median(off[..., 2], axis=0)).max() < 0.03


def test_people_face_as_recorded(recorded):
    for again, once in zip(recorded.motions, recorded.originals, strict=True):
        off = np.angle(np.exp(1j * (facing(again.root) - facing(once.root))))
        assert np.degrees(np.abs(off)).max() < 10
    ears, shoulders = ([COCO17.index(f"{side}_{name}") for side in ("left", "right")] for name in ("ear", "shoulder"))
    for pair in (ears, shoulders):
        lines = [joints[:, :, pair[0]] - joints[:, :, pair[1]] for joints in (recorded.joints, recorded.tracks.joints)]
        unit = [line / np.linalg.norm(line, axis=-1, keepdims=True) for line in lines]
        assert np.degrees(np.arccos(np.clip((unit[0] * unit[1]).sum(axis=-1), -1, 1))).max() < 10


def test_bodies_have_the_recorded_size(recorded):
    for k, mover in enumerate(recorded.cast):
        performed, wanted = body_lengths(recorded.joints[:, k]), body_lengths(recorded.tracks.joints[:, k])
        for name in wanted:
            assert performed[name] == pytest.approx(wanted[name], rel=0.03), (k, name)
        assert mover.body.stature == pytest.approx(performer(k).body.stature, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("person", "shoulders", "hips"), [(0, 0.8, 1.25), (1, 1.2, 0.8), (4, 1.3, 0.8)])
def test_bodies_are_as_wide_as_the_recorded_one(recorded, person, shoulders, hips):
    wide = Kinematics(make_body(replace(performer(person).body.shape, shoulders=shoulders, hips=hips)))
    joints = wide.joints(recorded.originals[person])
    tracks = people_at(RATE, joints[:, None])
    mover = Kinematics(make_body(recorded_shape(draw_shape(stream(70 + person, "other")), tracks, 0)))
    performed, wanted = body_lengths(mover.joints(reenact(tracks, 0, mover, time=TIME))), body_lengths(joints)
    for name in ("shoulders", "hips"):
        assert performed[name] == pytest.approx(wanted[name], abs=0.003)
        assert abs(performed[name] - body_lengths(recorded.joints[:, person])[name]) > 0.02


def test_feet_stand_on_the_floor(recorded):
    for mover, motion in zip(recorded.cast, recorded.motions, strict=True):
        feet = np.logical_or(*foot_vertices(mover).values())
        lowest = [mover.body.skin(bones)[feet, 2].min() for bones in mover.transforms(motion)[::5]]
        assert min(lowest) > -0.01
        assert np.median(lowest) < 0.005


def test_the_pose_is_held_outside_of_the_recording(recorded):
    person, mover = 0, recorded.cast[0]
    time = np.array([-3.0, -0.5, 0.0, 1.0, TIME[-1], TIME[-1] + 0.5, 60.0])
    motion = reenact(recorded.tracks, person, mover, time=time)
    for first, others in ((2, (0, 1)), (4, (5, 6))):
        for other in others:
            np.testing.assert_array_equal(motion.root[other], motion.root[first])
            np.testing.assert_array_equal(motion.angles[other], motion.angles[first])
    assert np.linalg.norm(motion.root[3, :2] - motion.root[2, :2]) > 0.5


@pytest.mark.parametrize("person", range(len(ACTIVITIES)))
def test_a_moved_recording_gives_the_moved_motion(recorded, person):
    turn, shift = (
        Rotation.from_euler("Z", 2.0).as_matrix(),
        np.array([3.0, -1.0, 0.4]),
    )  # the recorded height does not matter
    joints = recorded.tracks.joints @ turn.T + shift
    moved = reenact(people_at(RATE, joints), person, recorded.cast[person], time=TIME)
    still = recorded.motions[person]
    np.testing.assert_allclose(moved.root[:, :3], still.root[:, :3] @ turn.T + [3.0, -1.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(moved.angles, still.angles, atol=0.02)


def test_the_rate_of_the_recording_does_not_matter(recorded):
    joints = np.stack([record(name, k, rate=50.0)[1] for k, name in enumerate(ACTIVITIES)], axis=1)
    for person, mover in enumerate(recorded.cast):
        fine = mover.joints(reenact(people_at(50.0, joints), person, mover, time=TIME))
        off = np.linalg.norm(fine - recorded.joints[:, person], axis=-1)
        assert np.median(off) < 0.01
        assert np.percentile(off, 99) < 0.06


def test_a_single_frame_is_a_pose(recorded):
    tracks = people_at(RATE, recorded.tracks.joints[:1])
    motion = reenact(tracks, 1, recorded.cast[1], time=np.array([0.0, 1.0]))
    np.testing.assert_array_equal(motion.root[0], motion.root[1])
    off = np.linalg.norm(recorded.cast[1].joints(motion)[0] - tracks.joints[0, 1], axis=-1)
    assert np.median(off) < 0.05


class TestScenario:
    @pytest.fixture
    def planned(self, recorded, tmp_path):
        def plan(joints: np.ndarray, *, size: tuple[float, float, float] = (8.0, 8.0, 3.0), start: float = 0.0):
            (path,) = write_people(people_at(RATE, joints), tmp_path, formats=["npz"])
            people = {"count": joints.shape[1], "motion": {"file": str(path), "start": start}}
            scenario = Scenario(name="again", people=people, room={"size": size})
            return choreograph(scenario, recorded.cast[: joints.shape[1]], TIME[:25])

        return partial(plan, recorded.tracks.joints)

    def test_people_perform_their_tracks_from_the_start_on(self, recorded, planned):
        plan = planned(start=1.0)
        assert plan.props == ()
        for person, motion in enumerate(plan.motions):
            expected = reenact(recorded.tracks, person, recorded.cast[person], time=TIME[:25] + 1.0)
            np.testing.assert_array_equal(motion.time, TIME[:25])
            np.testing.assert_array_equal(motion.root, expected.root)
            np.testing.assert_array_equal(motion.angles, expected.angles)

    def test_people_may_touch(self, recorded, planned):
        together = recorded.tracks.joints[:, [1, 1]]
        one, other = planned.func(together).motions
        assert np.linalg.norm(one.root[:, :2] - other.root[:, :2], axis=1).max() < 0.05

    @pytest.mark.slow
    def test_who_leaves_the_room_is_refused(self, planned):
        with pytest.raises(ValueError, match=r"person \d leaves the room, .* first two numbers of room.size to \d"):
            planned(size=(3.0, 3.0, 3.0))
