"""Two people around one table: they sit or stand at it, talk, write, and reach for things on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.activities.sitting import Seat, fit_seat
from simharness.world.motion.interactions.partners import (
    arm_length,
    face_to_face,
    lean_forward,
    look_ahead,
    offset_angles,
)
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Spot
from simharness.world.motion.performance import Performance, Prop
from simharness.world.motion.poses.foot_placement import foot_path, pelvis_from_hips, spot_to_world, stance
from simharness.world.motion.poses.inverse_kinematics import pose_angles, reach_with, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.posture import blend, relaxed_posture
from simharness.world.motion.poses.timing import gesture_envelope, smooth_noise
from simharness.world.motion.registry import activity
from simharness.world.motion.trajectory import Trajectory

_SEATED = 0.65  # chance that they sit
_DEPTH, _WIDTH = (0.60, 0.72), (0.9, 1.3)  # metres, of the table between them and across
_BELLY = 0.07  # metres between the belly and the table
_BELOW_KNEE = 0.07  # metres from a knee down to the seat
_TOES_APART = 0.04  # metres between the toes of the two
_LAP = 0.21  # metres from the seat to the table top at least: thighs and the board
_OVER_SEAT = 0.27  # metres from the seat to the table top, usually
_UNDER_ELBOW = 0.04  # metres from the elbow down to the top of a table to stand at
_ON_TABLE = 0.022  # metres over the table where a palm rests: the wrist is thicker than the palm
_CHAIR = 0.46  # metres: width
_RESTING = np.radians([35.0, 10.0, 30.0, 70.0, 45.0, 0.0])  # an arm that lies on a table
# Of a hand that lies on its palm, fingers ahead.
_FLAT = {
    "right": np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "left": np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
_INWARD = np.radians(35.0)  # the fingers of both hands point towards each other


@dataclass(frozen=True)
class _Place:
    """One's place at the table.

    Attributes:
        spot: under the pelvis, facing the other.
        top: height of the table, metres.
        edge: from the pelvis to the edge of the table, metres.
        middle: from the pelvis to the middle of the table, metres.
    """

    spot: Spot
    top: float
    edge: float
    middle: float


@activity("table", performers=2, clearance=0.7)
def table(
    performers: Sequence[Kinematics], spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float
) -> Performance:
    """Sit or stand at opposite sides of a table; one talks, writes or reaches, the other does something else."""
    seated = rng.uniform() < _SEATED
    depth, width = rng.uniform(*_DEPTH), rng.uniform(*_WIDTH)
    first = int(rng.integers(len(_DOINGS)))
    other = (first + 1 + int(rng.integers(len(_DOINGS) - 1))) % len(_DOINGS)
    seats = [fit_seat(mover, below_knee=_BELOW_KNEE) for mover in performers] if seated else []
    top = _top(performers, seats)
    edges = [_belly(mover) + _BELLY for mover in performers]
    if seated:  # toes and knees find room under it
        depth = max(depth, sum(_toes(mover, seat) for mover, seat in zip(performers, seats, strict=True)) - sum(edges))
    between = edges[0] + depth + edges[1]
    spots = face_to_face(spot, between, share=(edges[0] + depth / 2) / between)
    props = [Prop("table", (depth, width, top), _standing(spot, 0.0, time))]
    motions = []
    for person, (mover, own) in enumerate(zip(performers, spots, strict=True)):
        place = _Place(own, top, edges[person], edges[person] + depth / 2)
        if seated:
            motion, ankles = _seated(mover, seats[person], own, time, rng)
            props.append(_chair(seats[person], own, ankles, time))
        else:
            motion = look_ahead(gesture("stand", mover, own, time, rng=rng))
        motions.append(_DOINGS[(first, other)[person]](mover, motion, place, time, rng))
    return Performance(tuple(motions), tuple(props))


def _top(performers: Sequence[Kinematics], seats: Sequence[Seat]) -> float:
    """The height of a table that suits both, metres."""
    if seats:
        heights = [seat.height for seat in seats]
        return max(max(heights) + _LAP, float(np.mean(heights)) + _OVER_SEAT)
    elbows = [mover.standing_height + mover.arms["right"].anchors[3][2] for mover in performers]
    return float(np.mean(elbows)) - _UNDER_ELBOW


def _belly(mover: Kinematics) -> float:
    """How far the front of the trunk is ahead of the pelvis, metres."""
    skin = mover.neutral_skin
    shoulder = mover.arms["right"].anchors[0]
    trunk = skin[(np.abs(skin[:, 1]) < 0.6 * abs(shoulder[1])) & (skin[:, 2] > 0.0) & (skin[:, 2] < 0.6 * shoulder[2])]
    return float(trunk[:, 0].max())


def _toes(mover: Kinematics, seat: Seat) -> float:
    """How far the toes of someone who sits are ahead of the pelvis, with a little air, metres."""
    return _ankles(seat) + float(max(sole[:, 0].max() for sole in mover.soles.values())) + _TOES_APART / 2


def _ankles(seat: Seat) -> float:
    """How far the ankles of someone who sits are ahead of the pelvis, metres."""
    return -float(seat.hip_at(np.zeros(1))[0, 0])


def _seated(mover: Kinematics, seat: Seat, own: Spot, time: Floats, rng: np.random.Generator) -> tuple[Motion, float]:
    """Someone who sits with the pelvis over a spot, and how far the ankles are ahead of it, metres."""
    lean = np.radians(-3.0 + 2.0 * smooth_noise(time, rng, 0.1))
    hip = seat.hip_at(lean)
    ankles = _ankles(seat)
    hip[:, 0] += ankles
    pelvis, height = pelvis_from_hips(mover, own, hip, lean=lean)
    curves = relaxed_posture(time, rng)
    for name in ("neck_rotation", "thorax_rotation"):
        curves[name] = 0.35 * curves[name]
    blend(curves, np.ones(len(time)), lumbar_flexion=5.0, thorax_flexion=4.0)
    feet = {}
    for side in SIDES:
        print_ = stance(mover, side, apart=1.15)
        feet[side] = foot_path(mover, own, time, print_.moved(ankles - print_.place[0]))
    return solve_legs(mover, time, pelvis, height, feet, pose_angles(len(time), **curves)), ankles


def _chair(seat: Seat, own: Spot, ankles: float, time: Floats) -> Prop:
    middle = ankles + (seat.front + seat.back) / 2
    return Prop("chair", (seat.front - seat.back, _CHAIR, seat.height), _standing(own, middle, time))


def _standing(spot: Spot, ahead: float, time: Floats) -> Trajectory:
    """Something that stands still ahead of a spot, facing as it does."""
    half = spot.bearing / 2
    pose = np.array([[*spot_to_world(spot, [ahead, 0.0]), 0.0, np.cos(half), 0.0, 0.0, np.sin(half)]])
    return Trajectory(time[:1], pose)


def _lay(mover: Kinematics, motion: Motion, place: _Place, side: str, at: Floats, roll: float = 0.0) -> Motion:
    """The same with a hand on or over the table.

    Args:
        mover: the body.
        motion: what everything else does.
        place: at the table.
        side: of the hand.
        at: the palm, metres beyond the edge of the table, to the left, and over it, (T, 3).
        roll: of the hand, from flat to its little finger's edge, radians.
    """
    sign = -1.0 if side == "right" else 1.0
    ground = spot_to_world(place.spot, at + [place.edge, 0.0, place.top + _ON_TABLE])
    tilt = Rotation.from_euler("ZX", [place.spot.bearing - sign * _INWARD, -sign * roll]).as_matrix()
    turns = np.tile(tilt @ _FLAT[side], (len(at), 1, 1))
    return reach_with(mover, motion, side, ground, turn=turns, guess=_RESTING, turn_weight=0.02)


def _rest(mover: Kinematics, side: str, frames: int) -> Floats:
    """Where a hand rests on the table, as of :func:`_lay`, (T, 3)."""
    aside = 0.16 if side == "left" else -0.16
    return np.tile([0.10, aside * arm_length(mover) / 0.6, 0.0], (frames, 1))


def _talk(mover: Kinematics, motion: Motion, place: _Place, time: Floats, rng: np.random.Generator) -> Motion:
    """The hands leave the table now and then and beat along with what is said."""
    motion = offset_angles(motion, neck_flexion=3.0 * smooth_noise(time, rng, 0.8))
    for side in SIDES:
        on = gesture_envelope(time, rng, hold=2.0, rest=1.0)
        beat = np.stack([0.05 * smooth_noise(time, rng, 0.6), 0.05 * smooth_noise(time, rng, 0.5), 0.0 * time], axis=-1)
        up = on * (0.13 + 0.05 * smooth_noise(time, rng, 0.7))
        at = _rest(mover, side, len(time)) + on[:, None] * beat
        at[:, 2] += up
        motion = _lay(mover, motion, place, side, at)
    return motion


def _write(mover: Kinematics, motion: Motion, place: _Place, time: Floats, rng: np.random.Generator) -> Motion:
    """The right hand writes, the left one holds the paper, the eyes are on it."""
    lean = 8.0 + 4.0 * rng.uniform()
    motion = offset_angles(lean_forward(motion, lean), neck_flexion=16.0 + lean)
    motion = _lay(mover, motion, place, "left", _rest(mover, "left", len(time)))
    rate, phase = rng.uniform(1.6, 2.4), rng.uniform(0, 2 * np.pi)
    stroke = 2 * np.pi * rate * time + phase
    at = _rest(mover, "right", len(time)) + [0.03, 0.07, 0.0]
    at[:, 0] += 0.005 * np.sin(stroke)
    at[:, 1] += 0.05 * smooth_noise(time, rng, 0.15) + 0.004 * np.cos(stroke)
    return _lay(mover, motion, place, "right", at, roll=np.radians(35.0))


def _reach(mover: Kinematics, motion: Motion, place: _Place, time: Floats, rng: np.random.Generator) -> Motion:
    """Now and then a hand goes out to the middle of the table, and returns."""
    on, aside, far = (
        gesture_envelope(time, rng, hold=0.8, rest=1.2, raised=1.0),
        rng.uniform(-0.12, 0.12),
        rng.uniform(0.7, 1.0),
    )
    side = "right" if rng.uniform() < 0.75 else "left"
    other = "left" if side == "right" else "right"
    motion = lean_forward(motion, 4.0 + 14.0 * on)
    motion = _lay(mover, motion, place, other, _rest(mover, other, len(time)))
    at = _rest(mover, side, len(time))
    target = np.array([far * (place.middle - place.edge), aside, 0.05])
    at = at + on[:, None] * (target - at) + (4 * on * (1 - on))[:, None] * [0.0, 0.0, 0.06]
    return _lay(mover, motion, place, side, at)


_Doing = Callable[[Kinematics, Motion, _Place, Floats, np.random.Generator], Motion]
_DOINGS: tuple[_Doing, ...] = (_talk, _write, _reach)
