import numpy as np
import pytest

from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import DOFS
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.activities.gait import RUN
from simharness.world.motion.activities.round_loops import make_stride, run
from simharness.world.motion.paths import make_loop
from simharness.world.motion.poses.kinematics import Kinematics

TIME = np.arange(0.0, 3.0, 1 / 60)


@pytest.fixture(scope="module", params=[0, 4])
def kinematics(request):
    return Kinematics(make_body(draw_shape(stream(request.param, "run"))))


@pytest.fixture(scope="module")
def running(kinematics):
    around = np.linspace(0, 2 * np.pi, 600, endpoint=False)
    way = 5.0 * np.stack([np.cos(around), np.sin(around)], axis=-1)
    loop = make_loop(way, speed=0.9 * np.sqrt(9.81 * kinematics.leg_length), start=0.0)
    motion = run(kinematics, loop, TIME, rng=stream(1, "run"), pace=1.1)
    return loop, motion, kinematics.transforms(motion)


def test_the_curves_pass_the_published_landmarks():
    """Novacheck 1998: foot off at 39 %, the knee 40 to 45 degrees in stance and about 90 in swing."""
    phase = np.linspace(0, 1, 1001)
    hip, knee, ankle = np.degrees(RUN.angles(phase)).T
    stance = phase < RUN.foot_off
    assert 36 <= knee[stance].max() <= 46
    assert 85 <= knee.max() <= 95
    assert 0.6 <= phase[knee.argmax()] <= 0.7
    assert 40 <= hip.max() <= 50
    assert phase[hip.argmin()] == pytest.approx(0.42, abs=0.05)
    assert -25 <= ankle.min() <= -15
    np.testing.assert_allclose(RUN.angles(0.0), RUN.angles(1.0))


def test_there_is_a_flight_in_every_step(kinematics, running):
    _, _, transforms = running
    lowest = np.array([kinematics.body.skin(pose)[:, 2].min() for pose in transforms])
    aloft = lowest > 0.001
    assert 0.08 < aloft.mean() < 0.3
    steps = np.count_nonzero(aloft[1:] & ~aloft[:-1])
    cadence = steps / TIME[-1] * 60
    assert 140 < cadence < 200  # steps per minute: joggers take 150 to 180
    assert lowest.min() > -0.01


def test_knees_and_arms_are_those_of_a_runner(running):
    _, motion, _ = running
    angles = {name: np.degrees(motion.angles[:, k]) for k, name in enumerate(DOFS)}
    for side in ("left", "right"):
        assert angles[f"{side}_knee_flexion"].max() > 70
        assert np.ptp(angles[f"{side}_hip_flexion"]) > 40
        assert angles[f"{side}_elbow_flexion"].min() > 60
        assert np.corrcoef(angles[f"{side}_shoulder_flexion"], angles[f"{side}_hip_flexion"])[0, 1] < -0.5


def test_the_pelvis_bobs_twice_per_stride(kinematics, running):
    loop, motion, _ = running
    stride = make_stride(kinematics, speed=loop.speed, pace=1.1)
    height = motion.root[:, 2]
    assert 0.02 < np.ptp(height) < 0.1  # metres
    waves = np.count_nonzero(np.diff(np.sign(height - height.mean())) > 0)
    assert waves == pytest.approx(2 * stride.frequency * TIME[-1], abs=1.01)
    assert stride.stride * stride.frequency == pytest.approx(loop.speed)


def test_a_sprint_is_refused(kinematics):
    with pytest.raises(ValueError, match=r"tall runs at \d\.\d+ to \d\.\d+ m/s, not at 9 m/s"):
        make_stride(kinematics, speed=9.0)
