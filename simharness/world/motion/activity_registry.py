"""Registry of activities: what one person, or two people together, can do.

How to add an activity:

1. Write one module in ``activities/`` (one person) or ``interactions/`` (two people). Decorate its function with
   :func:`solo_activity` if it moves one body, otherwise with :func:`activity`::

       @solo_activity("squat", clearance=0.2)
       def squat(kinematics, spot, time, *, rng, pace) -> Motion: ...

       @activity("hand_over", performers=2, clearance=0.5)
       def hand_over(performers, spot, time, *, rng, pace) -> Performance: ...

2. Add the name to ``ActivityName`` in ``simharness/scenario/sections/people_section.py``, the names that scenario files
   accept.

Nothing else lists activities: :func:`activities` imports every module of the two folders. The tests in
``tests/simharness/world/motion`` (``test_activities.py``, ``test_interactions.py``) run on every registered activity:
feet do not slide, no skin is below the floor, and joint angles stay within their ranges.

A gesture of a standing person is shorter still: one function in ``activities/gestures.py`` that changes joint angle
curves, with the decorator that is defined there, and its name as in step 2.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any, TypeVar, get_args

import numpy as np

from mvpose.arrays import Floats
from simharness.scenario.sections.people_section import ActivityName, PeopleSection
from simharness.world.motion.motion import Motion, Performance
from simharness.world.motion.paths import Loop, Route, Spot, Track
from simharness.world.motion.poses.kinematics import Cast

_PACKAGES = ("simharness.world.motion.activities", "simharness.world.motion.interactions")
_STROLL = (0.28, 0.39)  # Froude numbers: people stroll in a room; 0.42 is comfortable outdoors
_registered: "dict[str, Activity]" = {}

Perform = TypeVar("Perform", bound=Callable[..., Performance])
Move = TypeVar("Move", bound=Callable[..., Motion | Performance])


@dataclass(frozen=True)
class Activity:
    """Activity of one person, or of two together."""

    name: str
    """Name in scenario files."""
    perform: Callable[..., Performance]
    """Function of the performers' ``Kinematics`` in order, the track, and the times (N,) in seconds at which to plan
    (ascending, at ``RATE``), with the keywords ``rng`` (random generator for the manner) and ``pace`` (cadence relative
    to the usual one); returns a :class:`Performance`. Apart from its ends, the result must not depend on the length of
    ``time``."""
    performers: int = 1
    """Number of people that it takes."""
    track: type[Loop] | type[Spot] | type[Route] = Spot
    """Kind of track: a :class:`Loop` to walk or run round, a :class:`Spot`, or the :class:`Route` of a visitor.
    Performers share a spot: its place is in the middle, and its bearing points from the first to the second."""
    clearance: float = 0.0
    """Radius in metres around the track's position that the performers' pelvises may use; their arms may reach beyond.
    Tracks of other people stay ``people.spacing`` further away."""
    froude: tuple[float, float] = _STROLL
    """Lowest and highest speed over sqrt(g x leg length), for activities on a loop."""
    fewest: int = 0
    """Least number of people that it takes, where fewer are left; 0: ``performers``."""
    configured: "Callable[[Activity, PeopleSection], Activity]" = lambda each, people: each
    """Function of the activity and the section ``[people]`` of a scenario that returns the activity with the parameters
    of the scenario."""


def activity(name: str, **attributes: Any) -> Callable[[Perform], Perform]:
    """Register the decorated function as an activity with the other attributes of :class:`Activity`.

    The function takes a sequence of ``Kinematics`` and returns a :class:`Performance`, see ``Activity.perform``.
    """

    def register(perform: Perform) -> Perform:
        if name in _registered:
            raise ValueError(f"the activity {name!r} is registered twice: choose another name for one of them")
        _registered[name] = Activity(name, perform, **attributes)
        return perform

    return register


def solo_activity(name: str, **attributes: Any) -> Callable[[Move], Move]:
    """Register the decorated function as an activity of one person; arguments as for :func:`activity`.

    The function takes one ``Kinematics`` instead of a sequence; without props it may return the :class:`Motion` alone.
    """

    def register(move: Move) -> Move:
        activity(name, **attributes)(solo(move))
        return move

    return register


def solo(move: Callable[..., Motion | Performance]) -> Callable[..., Performance]:
    """Return ``move``, a function of one ``Kinematics``, as an ``Activity.perform``."""

    def perform(performers: Cast, track: Track, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
        (kinematics,) = performers
        made = move(kinematics, track, time, rng=rng, pace=pace)
        return made if isinstance(made, Performance) else Performance((made,))

    return perform


@cache
def activities() -> Mapping[str, Activity]:
    """Return all registered activities by name, in the order of ``ActivityName``.

    "mocap" is not one of them: it is made from a recording (``simharness.world.motion.mocap``).

    Raises:
        ValueError: an activity whose name is not in ``ActivityName``.
    """
    for package in _PACKAGES:
        for module in iter_modules(import_module(package).__path__):
            import_module(f"{package}.{module.name}")
    names = get_args(ActivityName)
    unlisted = sorted(set(_registered) - set(names))
    if unlisted:
        raise ValueError(
            f"the activity {unlisted[0]!r} is registered, but scenario files do not accept it: add its name to "
            "ActivityName in simharness/scenario/sections/people_section.py"
        )
    return MappingProxyType({name: _registered[name] for name in names if name in _registered})


def configured_activities(people: PeopleSection) -> dict[str, Activity]:
    """Return all registered activities by name, with the parameters of a scenario."""
    return {name: each.configured(each, people) for name, each in activities().items()}
