"""What comes of an activity: how its performers move, and the things that they use."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Loop, Spot, Track
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.trajectory import Trajectory

PropKind = Literal["chair", "table", "box", "step", "bottle"]


@dataclass(frozen=True)
class Prop:
    """A thing that an activity needs; ``simharness.world.scene.objects.props`` gives it a shape.

    Attributes:
        kind: what it is.
        size: its extent along its own x (depth), y (width) and z (height), metres; of a chair z is the height of the
            seat, of a table that of its top.
        trajectory: where it is. Its origin is the middle of its underside; a chair faces its own +x.
    """

    kind: PropKind
    size: tuple[float, float, float]
    trajectory: Trajectory


@dataclass(frozen=True)
class Performance:
    """How the performers of one activity move, in their order, and their props."""

    motions: tuple[Motion, ...]
    props: tuple[Prop, ...] = ()


@dataclass(frozen=True)
class Activity:
    """Something that one person does, or two together.

    Attributes:
        name: as scenarios call it.
        performers: how many people it takes, 1 or 2.
        track: what it happens on: a :class:`Loop` to go round, or a :class:`Spot`, which two share: its place is the
            middle between them, and its bearing leads from the first to the second.
        clearance: metres around the track's position that the performers' pelvises, and whatever of them reaches as
            far as an arm beyond, may fill; other people's tracks keep ``people.spacing`` more away.
        froude: speed over sqrt(g x leg length), least and most, of those who go round a loop.
        perform: called with the performers' ``Kinematics`` in order, the track, the times (N,) at which to plan
            (ascending, at ``RATE``), and by keyword ``rng`` (draws the manner) and ``pace`` (cadence over the usual);
            returns the :class:`Performance`. It must not depend on how long ``time`` is, beyond its ends.
    """

    name: str
    performers: int
    track: type[Loop] | type[Spot]
    clearance: float
    perform: Callable[..., Performance]
    froude: tuple[float, float] = (0.28, 0.39)  # people stroll in a room; 0.42 is comfortable outdoors


def solo(move: Callable[..., Motion]) -> Callable[..., Performance]:
    """Make a performance of a function of one ``Kinematics`` that returns a motion and uses no props."""

    def perform(
        performers: Sequence[Kinematics],
        track: Track,
        time: NDArray[np.float64],
        *,
        rng: np.random.Generator,
        pace: float,
    ) -> Performance:
        (kinematics,) = performers
        return Performance((move(kinematics, track, time, rng=rng, pace=pace),))

    return perform
