"""Activities "cross" and "swap": people walk towards each other on parallel lanes, pass close by, and come back.

Neighbouring lanes are ``people.passing`` apart and have opposite directions. Half of the people start at one end and
half at the other, and all are in the middle at the same time: two people pass each other, eight are two ranks that go
through each other. Who passes closer than shoulders are wide turns them.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mvpose.arrays import Floats
from simharness.scenario.sections.people_section import PeopleSection
from simharness.types.random_streams import stream
from simharness.world.motion.activities.route_walking import LOOKAHEAD, walk_route
from simharness.world.motion.activity_registry import Activity, activity
from simharness.world.motion.motion import Performance
from simharness.world.motion.paths import Itinerary, Route, Spot, turning_time, walking_time
from simharness.world.motion.poses.foot_placement import spot_to_world
from simharness.world.motion.poses.kinematics import Cast
from simharness.world.motion.poses.timing import ease

_LENGTH = 3.0  # metres of a lane
_FROUDE = 0.33  # of the stroll: speed over sqrt(g x leg length)
_GRAVITY = 9.81
_UNEVEN = 0.12  # seconds: people do not reach the middle at exactly the same time
_REST = {"cross": (0.1, 0.5), "swap": (1.5, 3.0)}  # seconds of standing at the end of a lane
_WIDE = 0.85  # metres between two people who pass without turning their shoulders
_NARROW = 0.5  # metres at which they turn them fully
_ABREAST, _TURNED = 0.3, 0.9  # metres from the middle up to which shoulders are turned, and in which they turn back


def _configured(each: Activity, people: PeopleSection) -> Activity:
    """Return the activity for the group and the distance of a scenario."""
    clearance = float(np.hypot(_LENGTH, (people.group - 1) * people.passing)) / 2
    perform = partial(each.perform, passing=people.passing)
    return replace(each, performers=people.group, fewest=2, clearance=clearance, perform=perform)


_PASSING = PeopleSection().passing
_PAIR: dict[str, Any] = {
    "performers": 2,
    "clearance": float(np.hypot(_LENGTH, _PASSING)) / 2,
    "configured": _configured,
}


@activity("cross", **_PAIR)
def cross(
    performers: Cast,
    spot: Spot,
    time: Floats,
    *,
    rng: np.random.Generator,
    pace: float,
    name: str = "cross",
    passing: float = _PASSING,
) -> Performance:
    """Walk to the other end of the lane, turn, and come back, again and again.

    As "swap": swap places with those opposite, turn round, stand face to face for a while, and swap again.
    """
    count = len(performers)
    speeds = [_FROUDE * float(np.sqrt(_GRAVITY * mover.leg_length)) for mover in performers]
    durations = [walking_time(_LENGTH, speed) for speed in speeds]
    offset, *uneven = rng.uniform(-1.0, 1.0, count + 1)
    sense = rng.choice([-1.0, 1.0], count)
    rests = stream(int(rng.integers(1 << 31)), name)  # a longer time takes more draws, and changes no other
    meetings = _meetings(max(durations), (offset + 1.0) / 2, float(time[-1]) + LOOKAHEAD, _REST[name], rests)
    yielded = float(np.clip((_WIDE - passing) / (_WIDE - _NARROW), 0.0, 1.0))
    motions = []
    for k, mover in enumerate(performers):
        left, forth = (k - (count - 1) / 2) * passing, k % 2 == 0  # lane of the person in the frame of the spot
        bearing = spot.bearing + (0.0 if forth else np.pi)
        start = spot_to_world(spot, [(-1.0 if forth else 1.0) * _LENGTH / 2, left])
        walker = Itinerary(start, bearing, speeds[k])
        for number, meeting in enumerate(meetings):
            walker.time = meeting + _UNEVEN * uneven[k] - durations[k] / 2
            walker.walk(_LENGTH).turn(bearing + (number + 1) * np.pi, sense=sense[k])
        route = walker.route()

        def yielding(time: Floats, route: Route = route, bearing: float = bearing) -> Floats:
            along = (route.position(time) - spot.place) @ [np.cos(bearing), np.sin(bearing)]
            near = 1.0 - ease((np.abs(along) - _ABREAST) / _TURNED)
            return yielded * near * np.sign(np.cos(route.heading(time) - bearing))

        motions.append(walk_route(mover, route, time, rng=rng, pace=pace, yielding=yielding))
    return Performance(tuple(motions))


activity("swap", **_PAIR)(partial(cross, name="swap"))


def _meetings(
    longest: float, share: float, end: float, rest: tuple[float, float], rng: np.random.Generator
) -> list[float]:
    """Return the times at which people meet in the middle, until all have arrived after ``end``, seconds."""
    least = longest + turning_time(np.pi) + 2 * _UNEVEN
    time = -share * least
    times = []
    while time - longest < end:
        times.append(time)
        time += least + rng.uniform(*rest)
    return times
