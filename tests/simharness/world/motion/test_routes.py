"""Routes: positions, speeds, headings and durations of legs, stops and turns."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.world.motion.paths import Itinerary, turning_time, walking_time

TIME = np.arange(-2.0, 20.0, 1 / 240)


def there_and_back():
    return Itinerary([1.0, -2.0], 0.5, 1.1, 0.7).walk(3.0).turn(0.5 + np.pi, sense=1.0).stand(1.5).walk(3.0)


def test_a_leg_has_its_length_direction_speed_and_duration():
    walker = Itinerary([1.0, -2.0], 0.5, 1.1, 0.7).walk(3.0)
    route = walker.route()
    ahead = np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(route.position(-5.0), [1.0, -2.0])
    np.testing.assert_allclose(route.position(0.7), [1.0, -2.0], atol=1e-12)
    np.testing.assert_allclose(route.position([walker.time, 99.0]), [np.array([1.0, -2.0]) + 3.0 * ahead] * 2)
    np.testing.assert_allclose(walker.place, route.position(99.0))
    assert walker.time - 0.7 == pytest.approx(walking_time(3.0, 1.1))
    speed = np.linalg.norm(route.velocity(TIME), axis=1)
    assert speed.max() == pytest.approx(1.1)
    assert route.fastest == pytest.approx(1.1)


def test_velocity_is_the_derivative_of_position_and_smooth():
    route = there_and_back().turn(2.0).walk(0.4).route()
    velocity = np.gradient(route.position(TIME), TIME, axis=0)
    np.testing.assert_allclose(velocity[1:-1], route.velocity(TIME)[1:-1], atol=2e-3)
    acceleration = np.linalg.norm(np.gradient(route.velocity(TIME), TIME, axis=0), axis=1)
    assert acceleration.max() < 3.0  # m/s², of a person who starts briskly


def test_turns_do_not_jump_and_people_walk_where_they_face():
    walker = there_and_back()
    route = walker.route()
    heading, velocity = route.heading(TIME), route.velocity(TIME)
    assert heading[0] == 0.5
    assert heading[-1] == pytest.approx(0.5 + np.pi)
    assert np.abs(np.gradient(heading, TIME)).max() < 1.6
    moving = np.linalg.norm(velocity, axis=1) > 1e-6
    facing = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    speed = np.linalg.norm(velocity[moving], axis=1)
    np.testing.assert_allclose((velocity[moving] * facing[moving]).sum(axis=1), speed, atol=1e-9)
    np.testing.assert_allclose(route.position(walker.time), [1.0, -2.0], atol=1e-9)


def test_half_turns_go_the_way_that_is_asked_for_and_others_the_shorter_way():
    for sense in (-1.0, 1.0):
        assert Itinerary([0, 0], 0.0, 1.0).turn(np.pi, sense=sense).bearing == pytest.approx(sense * np.pi)
    walker = Itinerary([0, 0], 3.0, 1.0).turn(-3.0)
    assert walker.bearing == pytest.approx(2 * np.pi - 3.0)
    assert walker.time == pytest.approx(turning_time(2 * np.pi - 6.0))


@pytest.mark.parametrize("seconds", [1.2, 2.0, 5.0, 30.0])
def test_a_slow_stretch_takes_the_seconds_that_are_asked_for(seconds):
    route = Itinerary([-1.5, 0.0], 0.0, 1.0).walk(3.0, slow=(1.0, 2.0, seconds)).route()
    time = np.arange(0.0, seconds + 5.0, 1e-3)
    x = route.position(time)[:, 0]
    assert (np.diff(x) >= -1e-12).all()
    assert np.count_nonzero(np.abs(x) < 0.5) * 1e-3 == pytest.approx(seconds, abs=5e-3)
    assert x[-1] == pytest.approx(1.5)


def test_a_stretch_is_not_passed_faster_than_people_walk():
    route = Itinerary([-1.5, 0.0], 0.0, 0.8).walk(3.0, slow=(1.0, 2.0, 0.5)).route()
    assert route.fastest == pytest.approx(0.8)
    assert route.position(99.0)[0] == pytest.approx(1.5)


def test_a_step_that_is_not_allowed_leaves_no_trace():
    walker = there_and_back()
    before, seen = walker.route(), []

    def refuse(way, start, end):
        seen.append((start, end, way.place.tolist()))
        return False

    assert not walker.attempt(lambda way: way.walk_to([5.0, 5.0]).stand(1.0), refuse)
    after = walker.route()
    assert seen[0][0] == walker.time
    assert seen[0][2] == pytest.approx([5.0, 5.0])
    np.testing.assert_array_equal(after.ramps, before.ramps)
    np.testing.assert_array_equal(after.turns, before.turns)
    assert walker.attempt(lambda way: way.walk_to([5.0, 5.0]), lambda *_: True)
    np.testing.assert_allclose(walker.route().position(99.0), [5.0, 5.0])
