import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simharness.types.random_streams import stream
from simharness.world.motion.poses.timing import bump, cycle_time, ease, gesture_envelope, minimum_jerk, smooth_noise

TIME = np.arange(0.0, 8.0, 1 / 40)


def test_ease_is_the_quintic_of_least_jerk():
    x = np.linspace(0, 1, 2001)
    velocity = np.gradient(ease(x), x)
    assert ease(0.5) == pytest.approx(0.5)
    assert velocity.max() == pytest.approx(1.875, abs=1e-3)  # Flash and Hogan 1985: 15/8 of the mean
    assert np.abs(velocity[[0, -1]]).max() < 1e-5
    assert ease(-3.0) == 0.0
    assert ease(4.0) == 1.0


@given(
    times=st.lists(st.floats(0.0, 10.0), min_size=2, max_size=6, unique=True).filter(
        lambda t: np.diff(sorted(t)).min() > 0.05
    ),
    values=st.lists(st.floats(-5, 5), min_size=6, max_size=6),
)
@settings(max_examples=50, deadline=None)
def test_minimum_jerk_passes_its_keys_and_stays_between_them(times, values):
    keys = list(zip(sorted(times), values, strict=False))
    t = np.linspace(-1.0, 11.0, 500)
    curve = minimum_jerk(t, *keys)
    at_keys = minimum_jerk(np.array([time for time, _ in keys]), *keys)
    np.testing.assert_allclose(at_keys, [value for _, value in keys], atol=1e-9)
    held = np.array([value for _, value in keys])
    assert curve.min() >= held.min() - 1e-9
    assert curve.max() <= held.max() + 1e-9
    assert curve[0] == pytest.approx(held[0])
    assert curve[-1] == pytest.approx(held[-1])


def test_bump_goes_up_once_and_comes_down():
    b = bump(TIME, 2.0, 3.0)
    assert b.max() == pytest.approx(1.0)
    assert TIME[b.argmax()] == pytest.approx(2.5)
    assert not b[(TIME <= 2.0) | (TIME >= 3.0)].any()


def test_cycles_repeat():
    u, marks = cycle_time(TIME, (1.0, 0.5, 2.0), rng=stream(0, "r"), pace=1.2)
    assert len(marks) == 4
    assert marks[0] == 0.0
    parts = np.diff(marks) * 1.2 / [1.0, 0.5, 2.0]
    assert (np.abs(parts - 1) <= 1 / 6).all()
    assert u.min() >= 0
    assert u.max() < marks[-1]
    later, _ = cycle_time(TIME + marks[-1], (1.0, 0.5, 2.0), rng=stream(0, "r"), pace=1.2)
    np.testing.assert_allclose(np.exp(2j * np.pi * later / marks[-1]), np.exp(2j * np.pi * u / marks[-1]), atol=1e-9)


def test_gesture_envelope_and_smooth_noise_keep_their_bounds():
    for k in range(50):
        on = gesture_envelope(TIME, stream(k, "on"), hold=2.0, rest=0.8)
        assert on.min() >= 0
        assert on.max() <= 1
        assert on.max() > 0.99  # in 8 s it is done at least once
        assert np.abs(np.diff(on)).max() < 0.12
        assert np.abs(smooth_noise(TIME, stream(k, "w"), 0.3)).max() <= 1.0


def test_every_gesture_is_made_within_four_seconds():
    early = TIME[TIME < 4]
    assert all(gesture_envelope(early, stream(k, "on"), hold=2.4, rest=0.8).max() > 0.9 for k in range(200))
