"""Who does what, where: from the people of a scenario to everyone's motion and the things that they use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simharness.motion.activities import ACTIVITIES
from simharness.motion.kinematics import Kinematics
from simharness.motion.motion import Motion
from simharness.motion.paths import Loop, plan_tracks
from simharness.motion.performance import Prop
from simharness.random import stream
from simharness.scenario.models import Scenario

_PACE = (1.05, 1.25)  # steps in a room are short and quick


@dataclass(frozen=True)
class Choreography:
    """Everyone's motion in the order of the people, and the things that they use."""

    motions: tuple[Motion, ...]
    props: tuple[Prop, ...]


def choreograph(scenario: Scenario, cast: Sequence[Kinematics], time: NDArray[np.float64]) -> Choreography:
    """Plan what everybody does.

    Args:
        scenario: its people, seed and duration.
        cast: the bodies, in the order of the people.
        time: seconds, (N,), the times at which motions are planned (``motion_clock``).

    Raises:
        ValueError: people that do not fit, naming the keys of the scenario to change.
    """
    people, seed = scenario.people, scenario.seed
    activities = [ACTIVITIES[people.activities[i % len(people.activities)]] for i in range(people.count)]
    manner = [stream(seed, "people", i, "gait") for i in range(people.count)]
    drawn = [
        (rng.uniform(*activity.froude), rng.uniform(*_PACE)) for rng, activity in zip(manner, activities, strict=True)
    ]
    speeds = [froude * np.sqrt(9.81 * mover.leg_length) for (froude, _), mover in zip(drawn, cast, strict=True)]
    tracks = plan_tracks(
        seed,
        [speed if activity.track is Loop else None for speed, activity in zip(speeds, activities, strict=True)],
        area=people.area,
        spacing=people.spacing,
        duration=scenario.duration,
    )
    performances = [
        activity.perform([mover], track, time, rng=stream(seed, "people", i, "motion"), pace=pace)
        for i, (activity, mover, track, (_, pace)) in enumerate(zip(activities, cast, tracks, drawn, strict=True))
    ]
    return Choreography(
        motions=tuple(motion for performance in performances for motion in performance.motions),
        props=tuple(prop for performance in performances for prop in performance.props),
    )
