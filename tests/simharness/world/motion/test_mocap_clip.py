"""Recorded clips on bodies: feet on the floor, joints within their ranges, at the requested positions and times."""

from dataclasses import dataclass

import numpy as np
import pytest

from simharness.scenario.sections.people_section import MocapSection
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.shape import Shape
from simharness.world.motion.mocap import Clip, load_clip
from simharness.world.motion.mocap.retarget import pelvis_path, source_motion
from simharness.world.motion.mocap.skeleton import map_joints
from simharness.world.motion.motion import RATE, Motion
from simharness.world.motion.poses.kinematics import Kinematics

TOUCHING = 0.0015  # metres above the floor
CLIPS = [
    "cmu/02/02_01.amc",
    "cmu/02/02_03.amc",
    "cmu/02/02_04.amc",
    "cmu/03/03_01.amc",
    "bvh/AV_8Walk_Meredith_HVHA_Rep1.bvh",
    "bvh/test_freebvh.bvh",
    "bvh/test_mocapbank.bvh",
]
SHAPES = [Shape(gender=0.1, height=0.45), Shape(gender=0.95, height=0.3, weight=0.7)]


@dataclass(frozen=True)
class Played:
    clip: Clip
    kinematics: Kinematics
    motion: Motion
    feet: list[np.ndarray]  # left and right, (T, n, 3)


@pytest.fixture(scope="module")
def bodies():
    return [Kinematics(make_body(shape)) for shape in SHAPES]


@pytest.fixture(scope="module", params=[(clip, k % 2) for k, clip in enumerate(CLIPS)], ids=lambda p: p[0][-14:])
def played(request, bodies, shared_data) -> Played:
    name, which = request.param
    kinematics = bodies[which]
    clip = load_clip(MocapSection(file=str(shared_data / "motion" / name)))
    time = np.arange(0.0, min(clip.time[-1], 5.0), 1 / 60)
    motion = clip.perform(kinematics, time, place=(1.0, -2.0), bearing=0.7)
    body = kinematics.body
    most = body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(axis=1)]
    skins = np.array([body.skin(transforms) for transforms in kinematics.transforms(motion)])
    feet = [
        skins[:, np.isin(most, [body.index(f"{side}Foot"), body.index(f"{side}ToeBase")])].astype(float)
        for side in ("Left", "Right")
    ]
    return Played(clip, kinematics, motion, feet)


def test_feet_do_not_sink(played):
    for foot in played.feet:
        assert foot[..., 2].min() > -0.01


def test_feet_stand_and_do_not_slide(played):
    slides = []
    for foot in played.feet:
        touching = foot[..., 2] < TOUCHING
        both = touching[1:] & touching[:-1]
        moved = np.linalg.norm(np.diff(foot[..., :2], axis=0), axis=-1)
        slid = np.where(both, moved, 0.0).sum(axis=1) / np.maximum(both.sum(axis=1), 1)
        planted = both.any(axis=1)
        changes = np.flatnonzero(np.diff(planted.astype(int))) + 1
        for stance, on in zip(np.split(slid, changes), np.split(planted, changes), strict=True):
            if on[0]:
                slides.append(stance.sum())
    assert len(slides) >= 2
    assert max(slides) < 0.02


@pytest.mark.parametrize("which", [0, 1])
def test_uneven_ground_is_made_flat(bodies, shared_data, which):
    """Subject 03 walks over ground that rises and falls by 25 cm; the pelvis moves as on a level floor."""
    kinematics = bodies[which]
    clip = load_clip(MocapSection(file=str(shared_data / "motion/cmu/03/03_01.amc")))
    motion = clip.perform(kinematics, clip.time[:-1], place=(0.0, 0.0), bearing=0.0)
    assert np.ptp(motion.root[:, 2]) < 0.2
    assert motion.root[:, 2].min() > 0.75 * kinematics.standing_height
    lowest = np.array([kinematics.body.skin(pose)[:, 2].min() for pose in kinematics.transforms(motion)])
    assert np.abs(lowest).max() < 0.01  # somewhere it touches the floor, always


def test_knees_bend_like_the_recorded_ones(played):
    """Compare the angle between recorded thigh and shank; not for uneven ground, which is made flat."""
    recording = played.clip.recording
    if recording.file.startswith("03"):
        pytest.skip("uneven ground")
    limbs = map_joints(recording).limbs
    where, _ = recording.pose()
    recorded = np.arange(len(recording)) / recording.rate
    for side in ("left", "right"):
        hip, knee, ankle = (where[:, limbs[side][role]] for role in ("thigh", "shank", "foot"))
        thigh, shank = (way / np.linalg.norm(way, axis=1, keepdims=True) for way in (knee - hip, ankle - knee))
        bent = np.degrees(np.arctan2(np.linalg.norm(np.cross(thigh, shank), axis=1), (thigh * shank).sum(axis=1)))
        expected = np.interp(played.clip.moment(played.motion.time), recorded, bent)
        found = np.degrees(played.motion.angles[:, DOFS.index(f"{side}_knee_flexion")])
        assert np.median(np.abs(found - expected)) < 15.0
        assert np.corrcoef(found, expected)[0, 1] > 0.7


def test_joints_keep_their_limits(played):
    low, high = played.kinematics.ranges.T
    # Between samples a smooth curve may pass them by a hair.
    assert (played.motion.angles >= low - np.radians(1.0)).all()
    assert (played.motion.angles <= high + np.radians(1.0)).all()


def test_velocities_do_not_jump(played):
    """A runner's knee swings at 15 rad/s and reverses within 0.05 s; a jump of its velocity would exceed this."""
    speed = np.abs(np.diff(played.motion.angles, axis=0)) * 60
    assert speed.max() < 30.0
    acceleration = np.abs(np.diff(played.motion.angles, 2, axis=0)) * 60**2
    assert acceleration.max() < 1200.0
    assert np.quantile(acceleration.max(axis=1), 0.9) < 400.0


def test_a_clip_starts_at_the_given_position_and_bearing(played):
    np.testing.assert_allclose(played.motion.root[0, :2], [1.0, -2.0], atol=1e-9)
    w, x, y, z = played.motion.root[0, 3:]
    assert np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(0.7, abs=1e-6)


def test_a_small_body_takes_small_steps(bodies, shared_data):
    clip = load_clip(MocapSection(file=str(shared_data / "motion/cmu/02/02_01.amc")))
    source = source_motion(clip.recording, rate=RATE)
    ways = [np.linalg.norm(np.ptp(pelvis_path(source, kinematics)[:, :2], axis=0)) for kinematics in bodies]
    legs = [sum(kinematics.leg_parts) for kinematics in bodies]
    assert ways[1] / ways[0] == pytest.approx(legs[1] / legs[0], rel=0.01)
    assert 1.0 < ways[0] / clip.time[-1] < 1.7  # m/s, a walk


def test_a_clip_starts_at_its_start_and_plays_back_and_forth(bodies, shared_data):
    file = str(shared_data / "motion/cmu/02/02_01.amc")
    whole, later = load_clip(MocapSection(file=file)), load_clip(MocapSection(file=file, start=1.0))
    (kinematics, _) = bodies
    time = np.arange(-60, 600) / 60
    motion = later.perform(kinematics, time, place=(0.0, 0.0), bearing=0.0)
    raw = whole.perform(kinematics, np.array([0.0, 0.6]), place=(0.0, 0.0), bearing=0.0)
    at = later.moment(time)
    assert at[60] == pytest.approx(1.0)
    back = np.flatnonzero(np.isclose(at, at[60], atol=1e-3))
    assert len(back) >= 4
    for frame in back:
        np.testing.assert_allclose(motion.angles[frame], motion.angles[60], atol=0.02)
    first = later.perform(kinematics, np.array([-0.9999]), place=(0.0, 0.0), bearing=0.0)
    assert len(first) == 1
    assert len(raw) == 2
    step = np.linalg.norm(np.diff(motion.root[:, :3], axis=0), axis=1)
    assert step.max() * 60 < 2.0  # m/s: nowhere a leap
    acceleration = np.linalg.norm(np.diff(motion.root[:, :3], 2, axis=0), axis=1) * 60**2
    assert acceleration.max() < 25.0  # from walking one way to the other in 0.3 s is 9 m/s2


def test_motion_does_not_depend_on_the_duration(bodies, shared_data):
    clip = load_clip(MocapSection(file=str(shared_data / "motion/cmu/02/02_03.amc"), start=0.4))
    long = clip.perform(bodies[0], np.arange(-60, 300) / 60, place=(0.0, 0.0), bearing=0.0)
    short = clip.perform(bodies[0], np.arange(0, 90) / 60, place=(0.0, 0.0), bearing=0.0)
    np.testing.assert_array_equal(short.angles, long.angles[60:150])
    np.testing.assert_array_equal(short.root, long.root[60:150])


@pytest.mark.parametrize(
    ("mocap", "message"), [({"file": "walk.bvh"}, r"people.motion.file = 'walk.bvh': no such file")]
)
def test_missing_files_are_refused(mocap, message):
    with pytest.raises(ValueError, match=message):
        load_clip(MocapSection(**mocap))


def test_the_skeleton_beside_the_motion(tmp_path, shared_data):
    source = shared_data / "motion" / "cmu" / "02"
    (tmp_path / "walk.amc").write_bytes((source / "02_03.amc").read_bytes())
    file = str(tmp_path / "walk.amc")
    with pytest.raises(ValueError, match=r"expected one ASF file .*, found 0: set people.motion.skeleton"):
        load_clip(MocapSection(file=file))
    with pytest.raises(ValueError, match=r"people.motion.skeleton = 'none.asf': no such file"):
        load_clip(MocapSection(file=file, skeleton="none.asf"))
    (tmp_path / "one.ASF").write_bytes((source / "02.asf").read_bytes())
    assert len(load_clip(MocapSection(file=file)).recording) == 173
    (tmp_path / "two.asf").write_bytes((source / "02.asf").read_bytes())
    with pytest.raises(ValueError, match=r"expected one ASF file .*, found 2"):
        load_clip(MocapSection(file=file))
    assert len(load_clip(MocapSection(file=file, skeleton=str(tmp_path / "two.asf"))).recording) == 173
    with pytest.raises(ValueError, match=r"people.motion.start = 9 s is not within walk.amc: expected 0 to 1.433 s"):
        load_clip(MocapSection(file=file, skeleton=str(tmp_path / "two.asf"), start=9.0))
