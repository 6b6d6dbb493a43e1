"""Activities "hand_over" and "shake_hands" of two people.

They pass an object back and forth, a bottle with one hand or a box with both, or shake their right hands.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.activity_registry import activity
from simharness.world.motion.interactions.partners import Meeting, arm_length, lean_forward, look_ahead, plan_meeting
from simharness.world.motion.motion import Motion, Performance, Prop, PropKind, Trajectory
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import spot_to_world
from simharness.world.motion.poses.inverse_kinematics import reach_with
from simharness.world.motion.poses.kinematics import Cast, Kinematics
from simharness.world.motion.poses.timing import cycle_time, ease

_BOX_CHANCE = 0.5
_INWARD = np.radians(22.0)  # inward rotation of the fingers of the hand around a bottle
_HOLDING = np.radians([25.0, 8.0, 20.0, 75.0, 5.0, 0.0])  # angles of an arm that holds an object in front of the belly
_WAITS = 0.30, 0.10  # metres: waiting position of the object ahead of the pelvis and, for a bottle, to the right
_NEAR = 0.46  # least distance of a held object from the pelvis, in arm lengths


@dataclass(frozen=True)
class _Item:
    """Object that is handed over."""

    kind: PropKind
    """Kind of object."""
    size: tuple[float, float, float]
    """Depth, width and height, metres."""
    grips: tuple[float, float]
    """Heights above its underside at which the first and the second person hold it, metres; they differ, so that the
    hands do not touch."""
    behind: float
    """Distance of the grip from its centre towards the holder, metres."""


@dataclass(frozen=True)
class _Course:
    """Schedule of a cycle, times in seconds."""

    go: float
    """The object leaves the first person."""
    meet: float
    """Both people hold it, until ``part``."""
    part: float
    """It continues to the second person."""
    handed: float
    """It is with the second person."""
    back: float
    """It leaves the second person; both hold it after the time from ``go`` to ``meet``."""
    part_back: float
    """It continues to the first person."""
    home: float
    """It is with the first person again."""
    end: float
    """End of the cycle."""

    def given(self, u: Floats) -> Floats:
        """Return the position of the object, (T,): -1 with the first person, 0 between them, 1 with the second."""
        forth = ease((u - self.go) / (self.meet - self.go)) + ease((u - self.part) / (self.handed - self.part))
        meet_back = self.back + (self.meet - self.go)
        back = ease((u - self.back) / (meet_back - self.back))
        return forth - (back + ease((u - self.part_back) / (self.home - self.part_back))) - 1.0

    def holding(self, person: int, u: Floats) -> Floats:
        """Return how far the hands of a person hold the object, (T,) from 0 to 1."""
        meet_back = self.back + (self.meet - self.go)
        if person == 0:
            released = ease((u - self.part) / (self.handed - self.part))
            return 1.0 - released * (1 - ease((u - self.back) / (meet_back - self.back)))
        taken = ease((u - self.go) / (self.meet - self.go))
        return taken * (1 - ease((u - self.part_back) / (self.home - self.part_back)))


@activity("hand_over", performers=2, clearance=0.5)
def hand_over(performers: Cast, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """The first person holds out an object and the second takes it; then it is returned the same way."""
    box, bulk = rng.uniform() < _BOX_CHANCE, rng.uniform(size=3)
    if box:
        deep, wide, tall = np.array([0.20, 0.26, 0.18]) + np.array([0.08, 0.10, 0.08]) * bulk
        item = _Item("box", (float(deep), float(wide), float(tall)), (0.25 * tall, 0.75 * tall), 0.3 * deep)
    else:
        wide, tall = 0.065 + 0.02 * bulk[0], 0.26 + 0.06 * bulk[1]
        item = _Item("bottle", (wide, wide, tall), (0.25 * tall, 0.7 * tall), 0.0)
    parts = (0.6, 0.9, 0.35, 0.9, 0.6, 1.4, 0.9, 0.4)
    u, marks = cycle_time(time, parts, rng=rng, pace=pace)
    course = _Course(*marks[1:])
    meeting = plan_meeting(performers, spot, raised=0.42, stretched=0.92)
    given = course.given(u)
    path = _item_path(performers, meeting, item, given)
    turn = np.tile(Rotation.from_euler("Z", spot.bearing).as_quat(scalar_first=True), (len(time), 1))
    motions = []
    for person, mover in enumerate(performers):
        home_spot = meeting.spots[person]
        motion = look_ahead(gesture("stand", mover, home_spot, time, rng=rng))
        reaching = 1.0 - np.abs(given)
        motion = lean_forward(motion, ease(reaching) * (3.0 + meeting.lean[person]))
        motions.append(_hold(mover, motion, home_spot, item, person, path, course.holding(person, u)))
    prop = Prop(item.kind, item.size, Trajectory(time, np.concatenate([path, turn], axis=1)))
    return Performance(tuple(motions), (prop,))


def _item_path(performers: Cast, meeting: Meeting, item: _Item, given: Floats) -> Floats:
    """Return the centre of the underside of the object, (T, 3) metres, from its position ``given`` (T,)."""
    tall = item.size[2]
    middle = meeting.point - [0.0, 0.0, tall / 2]
    waits = []
    for mover, home_spot in zip(performers, meeting.spots, strict=True):
        ahead = max(_WAITS[0], _NEAR * arm_length(mover)) + item.behind
        right = 0.0 if item.kind == "box" else _WAITS[1]
        # In front of the belly, forearms about horizontal.
        height = mover.standing_height + 0.28 * mover.arms["right"].anchors[0][2] - tall / 2
        waits.append(np.append(spot_to_world(home_spot, [ahead, -right]), height))
    first, second = (np.maximum(sense * given, 0.0)[:, None] for sense in (-1.0, 1.0))
    return middle + first * (waits[0] - middle) + second * (waits[1] - middle)


def _hold(
    mover: Kinematics, motion: Motion, home_spot: Spot, item: _Item, person: int, path: Floats, weight: Floats
) -> Motion:
    """Return the motion with the hands at the object, blended by ``weight`` (T,)."""
    grip = path + [0.0, 0.0, item.grips[person]]
    sides = ("right",) if item.kind == "bottle" else ("right", "left")
    for side in sides:
        palm_faces = 1.0 if side == "right" else -1.0  # +1: to the left of the body
        inward = palm_faces * _INWARD if item.kind == "bottle" else 0.0
        turn = handshake_orientation(home_spot.bearing + inward)
        out = item.size[1] / 2 * palm_faces
        ahead = np.array([np.cos(home_spot.bearing), np.sin(home_spot.bearing), 0.0])
        place = grip - out * turn[:, 1] - item.behind * ahead
        turns = np.tile(turn, (len(path), 1, 1))
        motion = reach_with(mover, motion, side, place, turn=turns, weight=weight, guess=_HOLDING, turn_weight=0.02)
    return motion


_SHAKEN = (0.015, 0.03)  # metres: amplitude of the shaking
_SHAKE_RATE = (1.8, 2.6)  # Hz
_SHAKEN_INWARD = np.radians(22.0)  # rotation of the fingers of a right hand to the left
# Angles of an arm held out for a handshake, in the order of ``ARM``.
_HELD_OUT = np.radians([40.0, 6.0, 15.0, 50.0, 5.0, 0.0])


@activity("shake_hands", performers=2, clearance=0.5)
def shake_hands(performers: Cast, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Hold out the right hands, shake them a few times and let go, repeatedly."""
    meeting = plan_meeting(performers, spot)
    amplitude, rate, phase = rng.uniform(*_SHAKEN), rng.uniform(*_SHAKE_RATE), rng.uniform(0, 2 * np.pi)
    u, (_, taken, let_go, down, _) = cycle_time(time, (0.9, 2.2, 1.0, 1.0), rng=rng, pace=pace)
    on = ease(u / taken) * (1 - ease((u - let_go) / (down - let_go)))
    shaken = amplitude * ease((u - taken) / 0.3) * ease((let_go - u) / 0.3) * np.sin(2 * np.pi * rate * u + phase)
    place = meeting.point + np.column_stack([np.zeros((len(time), 2)), shaken])
    motions = []
    for person, mover in enumerate(performers):
        home = meeting.spots[person]
        motion = look_ahead(gesture("stand", mover, home, time, rng=rng))
        motion = lean_forward(motion, on * (3.0 + meeting.lean[person]))
        turn = handshake_orientation(home.bearing + _SHAKEN_INWARD)
        motions.append(
            reach_with(mover, motion, "right", place, turn=np.tile(turn, (len(time), 1, 1)), weight=on, guess=_HELD_OUT)
        )
    return Performance(tuple(motions))


def handshake_orientation(bearing: float) -> Floats:
    """Return the orientation (3, 3) of a hand with the fingers towards ``bearing`` (radians) and the thumb up."""
    return (Rotation.from_euler("Z", bearing) * Rotation.from_euler("Y", -np.pi / 2)).as_matrix()
