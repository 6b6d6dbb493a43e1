import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simharness.motion.paths import SWAY, Loop, Spot, draw_loop, make_loop, plan_tracks
from simharness.random import stream

TIME = np.linspace(0.0, 6.0, 301)


def circle(radius: float, *, clockwise: bool = False, speed: float = 1.0) -> Loop:
    around = np.linspace(0, 2 * np.pi, 400, endpoint=False) * (-1 if clockwise else 1)
    return make_loop(radius * np.stack([np.cos(around), np.sin(around)], axis=-1), speed=speed, start=0.0)


def test_circle_has_its_length_speed_and_curvature():
    loop = circle(1.5, speed=0.9)
    assert loop.length == pytest.approx(2 * np.pi * 1.5, rel=1e-4)
    np.testing.assert_allclose(loop.curvature(TIME), 1 / 1.5, rtol=1e-2)
    np.testing.assert_allclose(
        np.linalg.norm(np.gradient(loop.position(TIME), TIME, axis=0)[1:-1], axis=1), 0.9, rtol=2e-3
    )
    np.testing.assert_allclose(circle(1.5, clockwise=True).curvature(TIME), -1 / 1.5, rtol=1e-2)


def test_heading_is_the_way_it_goes():
    loop = draw_some_loop(0)
    step = loop.position(TIME + 1e-4) - loop.position(TIME - 1e-4)
    heading = loop.heading(TIME)
    off = np.angle(np.exp(1j * (np.arctan2(step[:, 1], step[:, 0]) - heading)))
    assert np.abs(off).max() < 1e-3


def draw_some_loop(seed: int, *, half: float = 2.0) -> Loop:
    rng = stream(seed, "loop")
    loops = (draw_loop(rng, half=half, speed=1.0) for _ in range(200))
    return next(loop for loop in loops if loop is not None)


@given(seed=st.integers(0, 10**6), half=st.floats(0.5, 4.0))
@settings(max_examples=20, deadline=None)
def test_loops_stay_in_and_turn_gently(seed, half):
    loop = draw_some_loop(seed, half=half)
    once = np.linspace(0.0, loop.length / loop.speed, 400)
    assert np.abs(loop.position(once)).max() <= half + 0.01
    assert np.abs(loop.curvature(once)).max() * loop.speed < 1.45  # radians a second
    closed = np.linalg.norm(loop.position(0.0) - loop.position(loop.length / loop.speed))
    assert closed < 1e-9


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("count", "area", "spacing"), [(4, 2.0, 0.8), (9, 2.0, 0.8), (6, 3.0, 1.5)])
def test_plan_keeps_everyone_apart_and_inside(seed, count, area, spacing):
    speeds = [1.1 if i % 2 == 0 else None for i in range(count)]
    tracks = plan_tracks(seed, speeds, area=area, spacing=spacing, duration=6.0)
    assert [isinstance(track, Loop) for track in tracks] == [speed is not None for speed in speeds]
    ways = np.stack([track.position(TIME) for track in tracks])
    assert np.abs(ways).max() <= area - SWAY + 0.01
    apart = np.linalg.norm(ways[:, None] - ways[None], axis=-1)[~np.eye(count, dtype=bool)]
    assert apart.min() >= spacing + 2 * SWAY - 0.03  # between the planner's instants


def test_one_more_person_moves_nobody():
    four = plan_tracks(5, [1.0, None, 1.0, None], area=2.0, spacing=0.8, duration=4.0)
    five = plan_tracks(5, [1.0, None, 1.0, None, 1.0], area=2.0, spacing=0.8, duration=4.0)
    for before, after in zip(four, five, strict=False):
        np.testing.assert_array_equal(before.position(TIME), after.position(TIME))


def test_plans_differ_by_seed_and_repeat():
    one, again, other = (
        plan_tracks(seed, [1.0, None], area=2.0, spacing=0.8, duration=4.0)[0].position(TIME) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0.1


def test_nobody_needs_no_room():
    assert plan_tracks(0, [], area=0.01, spacing=9.0, duration=4.0) == ()


def test_a_crowd_that_does_not_fit_is_told_what_to_change():
    with pytest.raises(ValueError, match=r"people.count = 9 .*people.area = 1 m.*people.spacing = 1.5 m") as error:
        plan_tracks(0, [None] * 9, area=1.0, spacing=1.5, duration=1.0)
    assert "lower people.count" in str(error.value)


def test_too_small_to_walk_in():
    with pytest.raises(ValueError, match=r"people.area = 0.3 m is too small to walk"):
        plan_tracks(0, [1.0], area=0.3, spacing=0.5, duration=1.0)
    (track,) = plan_tracks(0, [None], area=0.3, spacing=0.5, duration=1.0)
    assert isinstance(track, Spot)
