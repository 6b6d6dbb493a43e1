"""Two people hand a thing to and fro: a bottle in one hand, or a box in both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.interactions.handshake import handshake_orientation
from simharness.world.motion.interactions.partners import Meeting, arm_length, lean_forward, look_ahead, plan_meeting
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.performance import Performance, Prop, PropKind
from simharness.world.motion.poses.foot_placement import spot_to_world
from simharness.world.motion.poses.inverse_kinematics import reach_with
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import cycle_time, ease
from simharness.world.motion.registry import activity
from simharness.world.motion.trajectory import Trajectory

_BOX_CHANCE = 0.5
_INWARD = np.radians(22.0)  # the fingers of the hand around a bottle point a little to the other side
_HOLDING = np.radians([25.0, 8.0, 20.0, 75.0, 5.0, 0.0])  # an arm that holds something before the belly
_WAITS = 0.30, 0.10  # where it is held meanwhile: ahead of the pelvis and, a bottle, to the right, metres
_NEAR = 0.46  # of an arm's length: nearer than that nobody holds a thing


@dataclass(frozen=True)
class _Thing:
    """What is handed over.

    Attributes:
        kind: what it is.
        size: depth, width, height, metres.
        grips: how high over its underside the first and the second hold it, metres: their hands do not meet.
        behind: how far from its middle towards oneself one holds it, metres.
    """

    kind: PropKind
    size: tuple[float, float, float]
    grips: tuple[float, float]
    behind: float


@dataclass(frozen=True)
class _Course:
    """When, in a round, the thing goes to the second, is there, returns, and is with the first again. Seconds."""

    go: float
    meet: float
    leave: float
    there: float
    back: float
    again: float
    home: float
    end: float

    def given(self, u: Floats) -> Floats:
        """Where the thing is, (T,): -1 with the first, 0 in between, 1 with the second."""
        there = ease((u - self.go) / (self.meet - self.go)) + ease((u - self.leave) / (self.there - self.leave))
        meets = self.back + (self.meet - self.go)
        here = ease((u - self.back) / (meets - self.back)) + ease((u - self.again) / (self.home - self.again))
        return there - here - 1.0

    def holding(self, person: int, u: Floats) -> Floats:
        """How far one's hands are with the thing, (T,) from 0 to 1."""
        meets = self.back + (self.meet - self.go)
        taken = ease((u - self.go) / (self.meet - self.go)) * (1 - ease((u - self.again) / (self.home - self.again)))
        lost = ease((u - self.leave) / (self.there - self.leave)) * (1 - ease((u - self.back) / (meets - self.back)))
        return 1.0 - lost if person == 0 else taken


@activity("hand_over", performers=2, clearance=0.5)
def hand_over(
    performers: Sequence[Kinematics], spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float
) -> Performance:
    """The first holds out a thing, the second takes it; then the other way."""
    box, bulk = rng.uniform() < _BOX_CHANCE, rng.uniform(size=3)
    thing = _box(bulk) if box else _bottle(bulk)
    parts = (0.6, 0.9, 0.35, 0.9, 0.6, 1.4, 0.9, 0.4)
    u, marks = cycle_time(time, parts, rng=rng, pace=pace)
    course = _Course(*marks[1:])
    meeting = plan_meeting(performers, spot, raised=0.42, stretched=0.92)
    given = course.given(u)
    way = _way(performers, meeting, thing, given)
    turn = np.tile(Rotation.from_euler("Z", spot.bearing).as_quat(scalar_first=True), (len(time), 1))
    motions = []
    for person, mover in enumerate(performers):
        own = meeting.spots[person]
        motion = look_ahead(gesture("stand", mover, own, time, rng=rng))
        reaching = 1.0 - np.abs(given)
        motion = lean_forward(motion, ease(reaching) * (3.0 + meeting.lean[person]))
        motions.append(_hold(mover, motion, own, thing, person, way, course.holding(person, u)))
    prop = Prop(thing.kind, thing.size, Trajectory(time, np.concatenate([way, turn], axis=1)))
    return Performance(tuple(motions), (prop,))


def _bottle(bulk: Floats) -> _Thing:
    wide, tall = 0.065 + 0.02 * bulk[0], 0.26 + 0.06 * bulk[1]
    return _Thing("bottle", (wide, wide, tall), (0.25 * tall, 0.7 * tall), 0.0)


def _box(bulk: Floats) -> _Thing:
    deep, wide, tall = np.array([0.20, 0.26, 0.18]) + np.array([0.08, 0.10, 0.08]) * bulk
    return _Thing("box", (float(deep), float(wide), float(tall)), (0.25 * tall, 0.75 * tall), 0.3 * deep)


def _way(performers: Sequence[Kinematics], meeting: Meeting, thing: _Thing, given: Floats) -> Floats:
    """The middle of the thing's underside, (T, 3) metres, as it is given."""
    tall = thing.size[2]
    middle = meeting.point - [0.0, 0.0, tall / 2]
    waits = []
    for mover, own in zip(performers, meeting.spots, strict=True):
        ahead = max(_WAITS[0], _NEAR * arm_length(mover)) + thing.behind
        right = 0.0 if thing.kind == "box" else _WAITS[1]
        # Before the belly, forearms about level.
        height = mover.standing_height + 0.28 * mover.arms["right"].anchors[0][2] - tall / 2
        waits.append(np.append(spot_to_world(own, [ahead, -right]), height))
    first, second = (np.maximum(sense * given, 0.0)[:, None] for sense in (-1.0, 1.0))
    return middle + first * (waits[0] - middle) + second * (waits[1] - middle)


def _hold(
    mover: Kinematics, motion: Motion, own: Spot, thing: _Thing, person: int, way: Floats, weight: Floats
) -> Motion:
    """The same with the hands at the thing as far as ``weight`` says."""
    grip = way + [0.0, 0.0, thing.grips[person]]
    sides = ("right",) if thing.kind == "bottle" else ("right", "left")
    for side in sides:
        palm_faces = 1.0 if side == "right" else -1.0  # to the left of the own body
        inward = palm_faces * _INWARD if thing.kind == "bottle" else 0.0
        turn = handshake_orientation(own.bearing + inward)
        out = thing.size[1] / 2 * palm_faces
        place = grip - out * turn[:, 1] - thing.behind * np.array([np.cos(own.bearing), np.sin(own.bearing), 0.0])
        turns = np.tile(turn, (len(way), 1, 1))
        motion = reach_with(mover, motion, side, place, turn=turns, weight=weight, guess=_HOLDING, turn_weight=0.02)
    return motion
