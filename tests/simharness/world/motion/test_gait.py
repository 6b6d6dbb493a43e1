import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activities.gait import WALK, make_gait
from simharness.world.motion.poses.kinematics import Kinematics, roll_sole


@pytest.fixture(scope="module", params=[0, 1, 2])
def kinematics(request):
    return Kinematics(make_body(draw_shape(stream(request.param, "gait"))))


def test_normative_curves_have_the_published_landmarks():
    """Perry and Burnfield 2010, chapters 3 to 6: ranges of motion and when they are reached."""
    phase = np.linspace(0, 1, 1001)
    hip, knee, ankle = np.degrees(WALK.angles(phase)).T
    assert 38 <= np.ptp(hip) <= 46
    assert 0.48 <= phase[hip.argmin()] <= 0.57
    assert 55 <= knee.max() <= 68
    assert 0.68 <= phase[knee.argmax()] <= 0.76
    stance = phase < 0.3
    assert 12 <= knee[stance].max() <= 22
    assert 0.10 <= phase[stance][knee[stance].argmax()] <= 0.18
    assert 8 <= ankle.max() <= 15
    assert -22 <= ankle.min() <= -12
    assert 0.58 <= phase[ankle.argmin()] <= 0.67
    np.testing.assert_allclose(WALK.angles(0.0), WALK.angles(1.0))


def test_a_round_sole_rolls_like_a_wheel():
    radius, center = 0.1, np.array([0.02, 0.0, -0.05])
    around = np.linspace(0, 2 * np.pi, 7200, endpoint=False)
    rim = center + radius * np.stack([np.sin(around), 0 * around, np.cos(around)], axis=-1)
    rolling = roll_sole(rim)
    pitch = np.radians([-60.0, -20.0, 0.0, 15.0, 40.0])
    ahead, height = rolling.at(pitch)
    # The wheel's centre moves by -radius x pitch at constant height; the ankle is fixed to the wheel.
    x, z = center[0], center[2]
    expected = -radius * pitch - (x * np.cos(pitch) - z * np.sin(pitch)) + x
    np.testing.assert_allclose(ahead, expected, atol=5e-4)
    np.testing.assert_allclose(height, radius - (x * np.sin(pitch) + z * np.cos(pitch)), atol=1e-5)


def test_stance_and_swing(kinematics):
    gait = make_gait(kinematics, speed=1.1)
    phase = np.linspace(0.0, 1.0, 500, endpoint=False)
    pitch, lift, progress = gait.foot(phase)
    stance = phase < WALK.foot_off - 0.01
    assert np.abs(lift[stance]).max() < 1e-4
    assert np.abs(progress[stance]).max() < 1e-4
    assert lift.min() > -1e-4
    assert lift[(phase > 0.7) & (phase < 0.9)].min() > 0.008  # toe clearance: 1 to 2 cm, Winter 1992
    assert (np.diff(progress) > -2e-3).all()
    assert progress[-1] > 0.99
    assert 8 < np.degrees(pitch[0]) < 25  # heel first
    assert np.abs(np.degrees(pitch[(phase > 0.1) & (phase < 0.3)])).max() < 2.5  # then flat


def test_stride_and_speed_are_human(kinematics):
    gait = make_gait(kinematics, speed=1.3)
    assert gait.stride * gait.frequency == pytest.approx(1.3)
    # A comfortable stride is 0.75 to 0.9 of stature at the amplitude of the curves, Winter 1991.
    assert 0.7 < gait.stride / kinematics.body.stature < 0.95
    assert 0.9 < gait.vigour < 1.4
    assert gait.stride / 2 / (gait.frequency * 120) == pytest.approx(0.0065)
    stroll, quick = make_gait(kinematics, speed=0.8), make_gait(kinematics, speed=0.8, pace=1.3)
    assert quick.stride < stroll.stride < gait.stride
    assert stroll.frequency < quick.frequency
    assert stroll.vigour < gait.vigour


def test_running_speed_is_refused(kinematics):
    with pytest.raises(ValueError, match=r"tall walks at 0\.\d+ to \d\.\d+ m/s, not at 4 m/s"):
        make_gait(kinematics, speed=4.0)
