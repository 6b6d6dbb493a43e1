import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simharness.types.random_streams import stream
from simharness.world.motion.paths import (
    Loop,
    RecordedPath,
    Spot,
    draw_loop,
    draw_recorded,
    draw_spot,
    loop_limits,
    make_loop,
    rotation_2d,
)

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


def draw_some_loop(seed: int, *, half: float = 2.0) -> Loop:
    rng = stream(seed, "loop")
    limits = loop_limits(1.0, slowest=0.8, fastest=1.2, half=half, running=False)
    loops = (draw_loop(rng, half=half, speed=limits.speed, tightest=limits.tightest) for _ in range(1000))
    return next(loop for loop in loops if loop is not None)


def test_heading_is_the_direction_of_travel():
    loop = draw_some_loop(0, half=3.0)
    step = loop.position(TIME + 1e-4) - loop.position(TIME - 1e-4)
    heading = loop.heading(TIME)
    off = np.angle(np.exp(1j * (np.arctan2(step[:, 1], step[:, 0]) - heading)))
    assert np.abs(off).max() < 1e-3


@given(seed=st.integers(0, 10**6), half=st.floats(0.5, 4.0))
@settings(max_examples=20, deadline=None)
def test_loops_stay_in_turn_gently_and_close(seed, half):
    loop = draw_some_loop(seed, half=half)
    once = np.linspace(0.0, loop.length / loop.speed, 400)
    assert np.abs(loop.position(once)).max() <= half + 0.01
    assert np.abs(loop.curvature(once)).max() * loop.speed < 1.45  # radians per second
    closed = np.linalg.norm(loop.position(0.0) - loop.position(loop.length / loop.speed))
    assert closed < 1e-9


@given(half=st.floats(0.5, 6.0), speed=st.floats(0.5, 4.0), running=st.booleans())
def test_runners_slow_down_for_tight_bends(half, speed, running):
    limits = loop_limits(speed, slowest=0.5, fastest=5.0, half=half, running=running)
    assert limits.tightest < half  # a circle of that radius fits
    assert limits.speed <= min(speed, limits.fastest) + 1e-9
    assert limits.fastest**2 / limits.tightest <= (3.5 if running else 1.3**2 * limits.tightest) + 1e-9


def test_spots_are_inside_and_face_the_middle():
    spots = [draw_spot(stream(0, k), half=1.5) for k in range(300)]
    assert np.abs([spot.place for spot in spots]).max() <= 1.5
    inward = [-spot.place @ [np.cos(spot.bearing), np.sin(spot.bearing)] for spot in spots]
    assert np.mean(np.array(inward) > 0) > 0.9
    pairs = [draw_spot(stream(0, k), half=1.5, apart=True).bearing for k in range(300)]
    assert abs(np.mean(np.exp(1j * np.array(pairs)))) < 0.15  # bearings of pairs are uniform
    np.testing.assert_array_equal(spots[0].position(TIME), np.tile(spots[0].place, (len(TIME), 1)))


@given(seed=st.integers(0, 10**6))
def test_recorded_path_is_rotated_shifted_and_kept_inside(seed):
    offset = np.column_stack([TIME * 0.5, np.sin(TIME)])
    for k in range(50):
        way = draw_recorded(stream(seed, k), half=2.0, time=TIME, offset=offset)
        if way is not None:
            break
    places = way.position(TIME)
    assert np.abs(places).max() <= 2.0 + 1e-9
    np.testing.assert_allclose((places - places[0]) @ rotation_2d(way.spot.bearing), offset - offset[0], atol=1e-9)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(TIME)
    assert way.fastest == pytest.approx(steps.max())


def test_recorded_path_that_does_not_fit_is_not_drawn():
    long = np.column_stack([TIME, 0 * TIME])
    assert all(draw_recorded(stream(0, k), half=1.0, time=TIME, offset=long) is None for k in range(50))


def test_fastest_bounds_every_track():
    tracks = [
        Spot(np.ones(2), 0.3),
        circle(1.0, speed=0.8),
        RecordedPath(Spot(np.zeros(2), 1.0), TIME, np.c_[TIME, TIME]),
    ]
    for track, fastest in zip(tracks, (0.0, 0.8, np.sqrt(2)), strict=True):
        moved = np.linalg.norm(np.diff(track.position(TIME), axis=0), axis=1) / np.diff(TIME)
        assert track.fastest == pytest.approx(fastest)
        assert moved.max() <= fastest + 1e-3
