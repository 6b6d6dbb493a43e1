"""Activity "hide": walking through a booth with curtains, in which no camera sees the person for a while."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from simharness.scenario.sections.people_section import PeopleSection
from simharness.types.random_streams import stream
from simharness.world.motion.activities.route_walking import LOOKAHEAD, walk_route
from simharness.world.motion.activity_registry import Activity, activity
from simharness.world.motion.motion import Performance, Prop
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import spot_to_world
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.routes import Itinerary, turning_time
from simharness.world.motion.trajectory import Trajectory

_DEPTH, _WIDTH = 1.4, 1.1  # metres: size of the booth, along the way and across
_STRIDE = 0.3  # metres from the pelvis to the foremost part of a walking body, which must be behind the curtain
_OVER_HEAD = 0.25  # metres between the top of the head and the roof
_ENDS = 1.45  # metres from the middle of the booth to the places where people turn
_FROUDE = 0.33
_GRAVITY = 9.81
_REST = (0.3, 2.0)  # seconds of standing beside the booth


def _configured(each: Activity, people: PeopleSection) -> Activity:
    return replace(each, perform=partial(_perform, hidden=people.hidden))


@activity("hide", clearance=_ENDS, configured=_configured)
def hide(
    performers: Sequence[Kinematics], spot: Spot, time: np.ndarray, *, rng: np.random.Generator, pace: float
) -> Performance:
    """Walk through the booth, turn round on the other side, and come back, again and again."""
    return _perform(performers, spot, time, rng=rng, pace=pace, hidden=PeopleSection().hidden)


def _perform(
    performers: Sequence[Kinematics],
    spot: Spot,
    time: np.ndarray,
    *,
    rng: np.random.Generator,
    pace: float,
    hidden: float,
) -> Performance:
    (mover,) = performers
    speed = _FROUDE * float(np.sqrt(_GRAVITY * mover.leg_length))
    offset, sense = rng.uniform(), rng.choice([-1.0, 1.0])
    rests = stream(int(rng.integers(1 << 31)), "hide")  # a longer time takes more draws, and changes no other
    inside = (_ENDS - _DEPTH / 2 + _STRIDE, _ENDS + _DEPTH / 2 - _STRIDE, hidden)
    walker = Itinerary(spot_to_world(spot, [-_ENDS, 0.0]), spot.bearing, speed)
    walker.time = -2.0 - offset * (hidden + turning_time(np.pi) + 2.0)
    legs = 0
    while walker.time < time[-1] + LOOKAHEAD:
        legs += 1
        walker.walk(2 * _ENDS, slow=inside).turn(spot.bearing + legs * np.pi, sense=sense)
        walker.stand(rests.uniform(*_REST))
    motion = walk_route(mover, walker.route(), time, rng=rng, pace=pace)
    half = spot.bearing / 2
    pose = np.array([[*spot.place, 0.0, np.cos(half), 0.0, 0.0, np.sin(half)]])
    size = (_DEPTH, _WIDTH, round(mover.body.stature + _OVER_HEAD, 2))
    return Performance((motion,), (Prop("booth", size, Trajectory(np.zeros(1), pose)),))
