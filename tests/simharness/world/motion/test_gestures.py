import numpy as np
import pytest

from mvpose.skeleton import COCO17
from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activities.gestures import GESTURES, gesture
from simharness.world.motion.paths import SWAY, Spot
from simharness.world.motion.poses.kinematics import Kinematics

TIME = np.arange(0.0, 8.0, 1 / 40)
SPOT = Spot(place=np.array([1.0, -0.5]), bearing=0.7)


@pytest.fixture(scope="module", params=[0, 1])
def kinematics(request):
    return Kinematics(make_body(draw_shape(stream(request.param, "gesture"))))


@pytest.fixture(scope="module", params=list(GESTURES))
def done(request, kinematics):
    rng = stream(4, request.param, round(1e6 * kinematics.body.stature))
    return request.param, kinematics, gesture(request.param, kinematics, SPOT, TIME, rng=rng)


def test_feet_stay_where_they_are(done):
    _, kinematics, motion = done
    body = kinematics.body
    most = body.weight_bones[np.arange(len(body.vertices)), body.weights.argmax(axis=1)]
    foot = np.isin(most, [body.index(name) for name in ("LeftFoot", "RightFoot", "LeftToeBase", "RightToeBase")])
    sole = None
    for transforms in kinematics.transforms(motion)[::20]:
        skin = body.skin(transforms)
        assert abs(skin[:, 2].min()) < 0.003
        now = skin[foot & (skin[:, 2] < 0.01)] if sole is None else skin[sole]
        if sole is None:
            sole, first = foot & (skin[:, 2] < 0.01), now
        assert np.abs(now - first).max() < 0.003


def test_limits_and_smoothness(done):
    _, kinematics, motion = done
    low, high = kinematics.ranges.T
    assert (motion.angles >= low).all()
    assert (motion.angles <= high).all()
    velocity = np.diff(motion.angles, axis=0) * 40
    assert np.degrees(np.abs(velocity).max()) < 450
    assert np.degrees(np.abs(np.diff(velocity, axis=0)).max()) < 90


def test_pelvis_stays_on_the_spot_and_keeps_its_bearing(done):
    name, kinematics, motion = done
    assert np.linalg.norm(motion.root[:, :2] - SPOT.place, axis=1).max() < SWAY
    joints = kinematics.joints(motion)
    shoulders = joints[:, COCO17.index("left_shoulder")] - joints[:, COCO17.index("right_shoulder")]
    facing = np.arctan2(-shoulders[:, 0], shoulders[:, 1])
    assert np.abs(np.angle(np.exp(1j * (facing - SPOT.bearing)))).max() < np.radians(30), name


def test_hands_perform_the_named_gesture(kinematics):
    joints = {}
    for name in GESTURES:
        joints[name] = kinematics.joints(gesture(name, kinematics, SPOT, TIME, rng=stream(6, name)))
    hands = [COCO17.index(f"{side}_wrist") for side in ("left", "right")]
    shoulders = [COCO17.index(f"{side}_shoulder") for side in ("left", "right")]
    hips = [COCO17.index(f"{side}_hip") for side in ("left", "right")]
    facing = np.array([np.cos(SPOT.bearing), np.sin(SPOT.bearing), 0.0])

    above = {name: (x[:, hands, 2] - x[:, shoulders, 2]).max() for name, x in joints.items()}
    ahead = {name: ((x[:, hands] - x[:, hips]) @ facing).max() for name, x in joints.items()}
    arm = 0.25 * kinematics.body.stature
    assert above["wave"] > 0.1
    stretched = {
        name: np.linalg.norm((x[:, hands] - x[:, shoulders])[..., :2], axis=-1).max() for name, x in joints.items()
    }
    assert stretched["point"] > arm
    assert stretched["stand"] < 0.5 * arm
    assert 0.5 * arm < ahead["talk"] < 1.7 * arm
    assert above["stand"] < -0.3
    assert ahead["stand"] < 0.25
    # A waving hand goes to and fro.
    wave = joints["wave"][:, hands][:, (joints["wave"][:, hands, 2].max(axis=0)).argmax()]
    sideways = np.diff(wave @ np.cross([0, 0, 1], facing))
    assert np.count_nonzero(np.diff(np.sign(sideways))) >= 6


def test_same_stream_same_motion(kinematics):
    one, same, other = (gesture("talk", kinematics, SPOT, TIME[:20], rng=stream(k, "t")).angles for k in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.05


def test_motion_at_an_instant_does_not_depend_on_the_others(kinematics):
    whole = gesture("wave", kinematics, SPOT, TIME, rng=stream(1, "t")).angles
    every_other = gesture("wave", kinematics, SPOT, TIME[::2], rng=stream(1, "t")).angles
    np.testing.assert_allclose(whole[::2], every_other, atol=1e-9)


def test_knees_are_never_quite_straight_nor_much_bent(done):
    _, _, motion = done
    for side in ("left", "right"):
        knee = np.degrees(motion.angles[:, DOFS.index(f"{side}_knee_flexion")])
        assert knee.min() > 6
        assert knee.max() < 22
