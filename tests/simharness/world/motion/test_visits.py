"""People who come and go: through doors, by the scenario's shares, without touching anybody."""

from __future__ import annotations

import numpy as np
import pytest

from simharness.scenario.sections.people_section import TrafficSection
from simharness.scenario.sections.room_section import RoomSection
from simharness.scenario.sections.scenario import Scenario
from simharness.types.random_streams import stream
from simharness.world.humans.body import make_body
from simharness.world.humans.population import draw_shape
from simharness.world.motion.choreography import choreograph, roles
from simharness.world.motion.motion import motion_clock
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.visits import Visitor, draw_doors

ROOM = RoomSection(size=(8.0, 7.0, 3.0))
DURATION = 30.0


def visitor(seed=0, *, room=ROOM, **how):
    doors = draw_doors(seed, TrafficSection(doors=2), room, np.zeros((0, 3)))
    given = {"entering": True, "leaving": True, "away": 0.0, "speed": 1.0, **how}
    return Visitor(doors=doors, room=room, duration=DURATION, **given)


def drawn(seed=0, **how):
    return visitor(seed, **how).draw(stream(seed, "visit"), half=2.0, start=-1.0, free=lambda *_: True)


@pytest.mark.parametrize("seed", range(6))
def test_visitors_come_and_go_through_doors(seed):
    route = drawn(seed)
    ((came, went),) = route.presence.intervals
    assert 0.0 < came < went < DURATION
    time = np.arange(came, went, 0.01)
    place = route.position(time)
    beyond = np.abs(place) - [4.0, 3.5]
    threshold = np.abs(beyond.max(axis=1)) < 0.05
    doors = np.array([door.place for door in visitor(seed).doors])
    away = np.linalg.norm(place[:, None] - doors, axis=-1).min(axis=1)
    assert threshold.any()
    assert away[threshold].max() < 0.15  # through the middle of the opening
    assert away[beyond.max(axis=1) > 0].max() < 1.0  # and nowhere else behind a wall


def test_a_room_without_walls_ends_at_its_edge():
    open_room = RoomSection(size=(8.0, 7.0, 3.0), walls=False)
    route = drawn(2, room=open_room)
    ((came, went),) = route.presence.intervals
    beyond = (np.abs(route.position([came, went])) - [4.0, 3.5]).max(axis=1)
    np.testing.assert_allclose(beyond, 0.0, atol=0.03)
    time = np.arange(came + 0.05, went - 0.05, 0.05)
    assert (np.abs(route.position(time)) < [4.0, 3.5]).all()


def test_who_does_not_enter_is_there_and_who_does_not_leave_stays():
    stays = drawn(3, entering=False, leaving=False).presence
    assert stays.always
    ((came, went),) = drawn(3, entering=False).presence.intervals
    assert came == -np.inf
    assert went < DURATION
    ((came, went),) = drawn(3, leaving=False).presence.intervals
    assert came > 0
    assert went == np.inf


def test_who_left_comes_back_after_the_time_away():
    intervals = drawn(1, away=2.0).presence.intervals
    assert len(intervals) >= 2
    gaps = intervals[1:, 0] - intervals[:-1, 1]
    assert (gaps > 2.0).all()
    assert (gaps < 9.0).all()  # and the way behind the wall


def test_a_visitor_for_whom_no_way_is_free_gets_no_route():
    asked = []

    def free(route, start, end):
        asked.append((start, end))
        return len(asked) < 2

    assert visitor().draw(stream(0, "visit"), half=2.0, start=-1.0, free=free) is None
    assert all(start <= end for start, end in asked)


def test_doors_keep_clear_of_cameras_corners_and_each_other():
    for seed in range(20):
        free = draw_doors(seed, TrafficSection(doors=3), ROOM, np.zeros((0, 3)))
        camera = np.append(free[0].place + 0.3 * free[0].inward, 2.0)[None]
        moved = draw_doors(seed, TrafficSection(doors=3), ROOM, camera)
        assert np.linalg.norm(moved[0].place - free[0].place) > 0.5
        for doors in (free, moved):
            for k, door in enumerate(doors):
                axis = int(np.abs(door.inward).argmax())
                assert abs(door.place[axis]) == ROOM.size[axis] / 2
                assert abs(door.place[1 - axis]) <= ROOM.size[1 - axis] / 2 - 0.9
                assert door.place @ door.inward < 0
                assert all(np.linalg.norm(door.place - other.place) >= 1.5 for other in doors[:k])
    fewer = draw_doors(5, TrafficSection(doors=1), ROOM, np.zeros((0, 3)))
    np.testing.assert_array_equal(
        fewer[0].place, draw_doors(5, TrafficSection(doors=3), ROOM, np.zeros((0, 3)))[0].place
    )
    with pytest.raises(ValueError, match=r"people\.traffic\.doors = 8: no place for door"):
        draw_doors(0, TrafficSection(doors=8), RoomSection(size=(2.5, 2.5, 3.0)), np.zeros((0, 3)))


def scenario(seed=0, **people):
    given = {"count": 5, "activities": ("visit",), "area": 2.5, "spacing": 0.6, **people}
    return Scenario(name="test", seed=seed, duration=16.0, people=given, room={"size": (8.0, 8.0, 3.0)})


@pytest.fixture(scope="module")
def people():
    return [Kinematics(make_body(draw_shape(stream(0, "visitors", k)))) for k in range(5)]


def test_visitors_keep_their_distance_while_they_are_present(people):
    time = motion_clock(16.0, margin=1.0)
    plan = choreograph(scenario(), people, time)
    present = np.stack([each.at(time) for each in plan.presence], axis=1)
    place = np.stack([motion.root[:, :2] for motion in plan.motions], axis=1)
    place[~present] = np.nan
    distance = np.linalg.norm(place[:, :, None] - place[:, None], axis=-1) + 9.0 * np.eye(5)
    assert np.nanmin(distance) >= 0.6
    assert 0.2 < present.mean() < 0.95
    assert [prop.kind for prop in plan.props] == ["door", "door"]


def test_shares_of_traffic_make_visitors_of_people_who_do_something_alone():
    everyone = {"activities": ("walk", "cross", "hide", "wave"), "traffic": {"entering": 1.0}}
    assert roles(scenario(**everyone)) == ("visit", "cross", "cross", "hide", "visit")
    nobody = {**everyone, "traffic": {"entering": 0.0}}
    assert roles(scenario(**nobody)) == ("walk", "cross", "cross", "hide", "wave")
    share = [
        role == "visit"
        for seed in range(40)
        for role in roles(scenario(seed, activities=("walk",), traffic={"leaving": 0.3}))
    ]
    assert np.mean(share) == pytest.approx(0.3, abs=0.1)


def test_one_more_visitor_changes_nobody_who_walks(people):
    time = motion_clock(4.0, margin=1.0)
    walkers = {"activities": ("walk", "walk", "visit"), "area": 3.0}
    two = choreograph(scenario(count=2, **walkers), people[:2], time)
    three = choreograph(scenario(count=3, **walkers), people[:3], time)
    for one, other in zip(two.motions, three.motions, strict=False):
        np.testing.assert_array_equal(one.root, other.root)
