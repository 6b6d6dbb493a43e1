"""People who pass each other, and one who is hidden for a while."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from casting import penetration, performer

from simharness.scenario.sections.people_section import PeopleSection
from simharness.types.random_streams import stream
from simharness.world.motion.activity_registry import configured_activities
from simharness.world.motion.choreography import assign_activities
from simharness.world.motion.paths import SWAY, Spot

TIME = np.arange(-1.0, 21.0, 1 / 60)
SPOT = Spot(np.array([0.4, -0.3]), 0.8)


def played(name, count, *, seed=0, **keys):
    activity = configured_activities(PeopleSection(**keys))[name]
    cast = [performer(k) for k in range(count)]
    return activity, cast, activity.perform(cast, SPOT, TIME, rng=stream(seed, name), pace=1.15)


def meetings(one, other, within):
    """Return the distances at which two people pass, for all times at which they are nearest to each other."""
    distance = np.linalg.norm(one.root[:, :2] - other.root[:, :2], axis=1)
    nearest = (distance[1:-1] <= distance[:-2]) & (distance[1:-1] < distance[2:]) & (distance[1:-1] < within)
    return distance[1:-1][nearest]


@pytest.mark.parametrize("name", ["cross", "swap"])
@pytest.mark.parametrize("passing", [0.5, 0.9])
def test_two_people_pass_again_and_again_at_the_distance_that_is_asked_for(name, passing):
    activity, cast, performance = played(name, 2, passing=passing)
    near = meetings(*performance.motions, within=passing + 0.3)
    assert len(near) >= 2
    np.testing.assert_allclose(near, passing, atol=0.1)
    assert penetration(cast, performance.motions, TIME[::4]).max() < 0.01
    for motion in performance.motions:
        assert np.linalg.norm(motion.root[:, :2] - SPOT.place, axis=1).max() < activity.clearance + SWAY


def test_people_who_pass_change_sides():
    _, _, performance = played("swap", 2)
    along = [(m.root[:, :2] - SPOT.place) @ [np.cos(SPOT.bearing), np.sin(SPOT.bearing)] for m in performance.motions]
    for x in along:
        assert x.min() < -1.4
        assert x.max() > 1.4
    assert np.corrcoef(*along)[0, 1] < -0.95


@pytest.mark.slow
def test_eight_people_are_two_ranks_that_go_through_each_other():
    _, cast, performance = played("cross", 8, group=8, passing=0.5)
    assert penetration(cast, performance.motions, TIME[::12]).max() < 0.02
    passed = sum(len(meetings(performance.motions[k], performance.motions[k + 1], within=0.75)) for k in range(7))
    assert passed >= 14  # every neighbour at least twice


@pytest.mark.parametrize("hidden", [2.0, 6.0])
def test_who_hides_is_inside_the_booth_for_the_seconds_that_are_asked_for(hidden):
    _, (mover,), performance = played("hide", 1, hidden=hidden)
    (booth,) = performance.props
    away = performance.motions[0].root[:, :2] - booth.trajectory.pose[0, :2]
    along = away @ [np.cos(SPOT.bearing), np.sin(SPOT.bearing)]
    across = away @ [-np.sin(SPOT.bearing), np.cos(SPOT.bearing)]
    assert np.abs(across).max() < SWAY
    inside = np.abs(along) < booth.size[0] / 2 - 0.3  # with all of the body
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    stays = [b - a for a, b in itertools.pairwise(edges) if inside[a + 1]]
    np.testing.assert_allclose(np.array(stays) / 60, hidden, atol=0.1)
    assert booth.size[2] > mover.body.stature + 0.1
    head = mover.joints(performance.motions[0])[:, :5, 2].max()
    assert head < booth.size[2] - 0.1


def test_groups_take_as_many_as_are_left_but_never_one_alone():
    known = configured_activities(PeopleSection(group=4))
    groups = assign_activities([known["cross"], known["walk"]], 8, fallback=known["stand"])
    assert [(group.activity.name, len(group.people)) for group in groups] == [("cross", 4), ("walk", 1), ("cross", 3)]
    alone = assign_activities([known["cross"]], 5, fallback=known["stand"])
    assert [group.activity.name for group in alone] == ["cross", "stand"]
