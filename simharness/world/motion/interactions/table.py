"""Activity "table": two people sit or stand at a table and talk, write, or reach for objects on it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import OTHER, SIDES
from simharness.world.motion.activities.gestures import gesture
from simharness.world.motion.activities.sitting import Seat, fit_seat
from simharness.world.motion.activity_registry import activity
from simharness.world.motion.interactions import partners
from simharness.world.motion.motion import Motion, Performance, Prop
from simharness.world.motion.paths import Spot
from simharness.world.motion.poses.foot_placement import foot_path, pelvis_from_hips, spot_to_world, stance
from simharness.world.motion.poses.inverse_kinematics import PALM_DOWN, reach_with, solve_legs
from simharness.world.motion.poses.kinematics import Cast, Kinematics
from simharness.world.motion.poses.timing import blend, draw_side, gesture_envelope, relaxed_posture, smooth_noise

_SEATED = 0.65  # probability that they sit
_DEPTH, _WIDTH = (0.60, 0.72), (0.9, 1.3)  # metres: depth of the table between them, and its width
_BELLY = 0.07  # metres between the belly and the table
_BELOW_KNEE = 0.07  # metres: depth of the seat below the knees
_TOES_APART = 0.04  # metres between the toes of the two people
_LAP = 0.21  # metres: least height of the table top above the seat, for thighs and board
_OVER_SEAT = 0.27  # metres: usual height of the table top above the seat
_UNDER_ELBOW = 0.04  # metres: depth of a standing table below the elbows
_ON_TABLE = 0.022  # metres: height of a resting palm above the table; the wrist is thicker than the palm
_RESTING = np.radians([35.0, 10.0, 30.0, 70.0, 45.0, 0.0])  # angles of an arm that lies on a table
_INWARD = np.radians(35.0)  # inward rotation of the fingers of both hands


@dataclass(frozen=True)
class _Place:
    """Place of one person at the table."""

    spot: Spot
    """Spot under the pelvis, facing the other person."""
    top: float
    """Height of the table, metres."""
    edge: float
    """Distance from the pelvis to the edge of the table, metres."""
    middle: float
    """Distance from the pelvis to the centre of the table, metres."""


@activity("table", performers=2, clearance=0.7)
def table(performers: Cast, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Sit or stand at opposite sides of a table; each person talks, writes or reaches, and they differ."""
    seated = rng.uniform() < _SEATED
    depth, width = rng.uniform(*_DEPTH), rng.uniform(*_WIDTH)
    first = int(rng.integers(len(_TASKS)))
    other = (first + 1 + int(rng.integers(len(_TASKS) - 1))) % len(_TASKS)
    seats = [fit_seat(mover, below_knee=_BELOW_KNEE) for mover in performers] if seated else []
    top = _top(performers, seats)
    edges = [_belly(mover) + _BELLY for mover in performers]
    if seated:  # room for toes and knees under the table
        toes = [float(max(sole[:, 0].max() for sole in mover.soles.values())) for mover in performers]
        reach = [_ankles(seat) + ahead + _TOES_APART / 2 for seat, ahead in zip(seats, toes, strict=True)]
        depth = max(depth, sum(reach) - sum(edges))
    between = edges[0] + depth + edges[1]
    spots = partners.face_to_face(spot, between, share=(edges[0] + depth / 2) / between)
    props = [Prop.at_rest("table", (depth, width, top), spot.place, spot.bearing)]
    motions = []
    for person, (mover, home) in enumerate(zip(performers, spots, strict=True)):
        place = _Place(home, top, edges[person], edges[person] + depth / 2)
        if seated:
            motion, ankles = _seated(mover, seats[person], home, time, rng)
            middle = ankles + (seats[person].front + seats[person].back) / 2
            props.append(seats[person].chair(spot_to_world(home, [middle, 0.0]), home.bearing))
        else:
            motion = partners.look_ahead(gesture("stand", mover, home, time, rng=rng))
        motions.append(_TASKS[(first, other)[person]](mover, motion, place, time, rng))
    return Performance(tuple(motions), tuple(props))


def _top(performers: Cast, seats: Sequence[Seat]) -> float:
    """Return the height of a table that suits both people, metres."""
    if seats:
        heights = [seat.height for seat in seats]
        return max(max(heights) + _LAP, float(np.mean(heights)) + _OVER_SEAT)
    elbows = [mover.standing_height + mover.arms["right"].anchors[3][2] for mover in performers]
    return float(np.mean(elbows)) - _UNDER_ELBOW


def _belly(mover: Kinematics) -> float:
    """Return the distance from the pelvis forward to the front of the trunk, metres."""
    skin = mover.neutral_skin
    shoulder = mover.arms["right"].anchors[0]
    trunk = skin[(np.abs(skin[:, 1]) < 0.6 * abs(shoulder[1])) & (skin[:, 2] > 0.0) & (skin[:, 2] < 0.6 * shoulder[2])]
    return float(trunk[:, 0].max())


def _ankles(seat: Seat) -> float:
    """Return the distance from a seated pelvis forward to the ankles, metres."""
    return -float(seat.hip_at(np.zeros(1))[0, 0])


def _seated(mover: Kinematics, seat: Seat, home: Spot, time: Floats, rng: np.random.Generator) -> tuple[Motion, float]:
    """Return the motion of a person seated over a spot, and the distance of the ankles ahead of the pelvis, metres."""
    lean = np.radians(-3.0 + 2.0 * smooth_noise(time, rng, 0.1))
    hip = seat.hip_at(lean)
    ankles = _ankles(seat)
    hip[:, 0] += ankles
    pelvis, height = pelvis_from_hips(mover, home, hip, lean=lean)
    curves = relaxed_posture(time, rng)
    for name in ("neck_rotation", "thorax_rotation"):
        curves[name] = 0.35 * curves[name]
    blend(curves, np.ones(len(time)), lumbar_flexion=5.0, thorax_flexion=4.0)
    feet = {}
    for side in SIDES:
        print_ = stance(mover, side, apart=1.15)
        feet[side] = foot_path(mover, home, time, print_.moved(ankles - print_.place[0]))
    return solve_legs(mover, time, pelvis, height, feet, curves), ankles


def _lay(mover: Kinematics, motion: Motion, place: _Place, side: str, at: Floats, roll: float = 0.0) -> Motion:
    """Return the motion with a hand on or above the table.

    Args:
        mover: body.
        motion: motion to change.
        place: place at the table.
        side: side of the hand.
        at: position of the palm, metres beyond the edge of the table, to the left, and above it, (T, 3).
        roll: rotation of the hand from flat to the edge of its little finger, radians.
    """
    sign = -1.0 if side == "right" else 1.0
    ground = spot_to_world(place.spot, at + [place.edge, 0.0, place.top + _ON_TABLE])
    tilt = Rotation.from_euler("ZX", [place.spot.bearing - sign * _INWARD, -sign * roll]).as_matrix()
    turns = np.tile(tilt @ PALM_DOWN[side], (len(at), 1, 1))
    return reach_with(mover, motion, side, ground, turn=turns, guess=_RESTING, turn_weight=0.02)


def _rest(mover: Kinematics, side: str, frames: int) -> Floats:
    """Return the resting position of a hand on the table, (T, 3), in the coordinates of :func:`_lay`."""
    aside = 0.16 if side == "left" else -0.16
    return np.tile([0.10, aside * partners.arm_length(mover) / 0.6, 0.0], (frames, 1))


def _talk(mover: Kinematics, motion: Motion, place: _Place, time: Floats, rng: np.random.Generator) -> Motion:
    """Raise the hands from the table now and then and move them as in speech."""
    motion = partners.offset_angles(motion, neck_flexion=3.0 * smooth_noise(time, rng, 0.8))
    for side in SIDES:
        on = gesture_envelope(time, rng, hold=2.0, rest=1.0)
        beat = np.stack([0.05 * smooth_noise(time, rng, 0.6), 0.05 * smooth_noise(time, rng, 0.5), 0.0 * time], axis=-1)
        up = on * (0.13 + 0.05 * smooth_noise(time, rng, 0.7))
        at = _rest(mover, side, len(time)) + on[:, None] * beat
        at[:, 2] += up
        motion = _lay(mover, motion, place, side, at)
    return motion


def _write(mover: Kinematics, motion: Motion, place: _Place, time: Floats, rng: np.random.Generator) -> Motion:
    """Write with the right hand, hold the paper with the left, and look at it."""
    lean = 8.0 + 4.0 * rng.uniform()
    motion = partners.offset_angles(partners.lean_forward(motion, lean), neck_flexion=16.0 + lean)
    motion = _lay(mover, motion, place, "left", _rest(mover, "left", len(time)))
    rate, phase = rng.uniform(1.6, 2.4), rng.uniform(0, 2 * np.pi)
    stroke = 2 * np.pi * rate * time + phase
    at = _rest(mover, "right", len(time)) + [0.03, 0.07, 0.0]
    at[:, 0] += 0.005 * np.sin(stroke)
    at[:, 1] += 0.05 * smooth_noise(time, rng, 0.15) + 0.004 * np.cos(stroke)
    return _lay(mover, motion, place, "right", at, roll=np.radians(35.0))


def _reach(mover: Kinematics, motion: Motion, place: _Place, time: Floats, rng: np.random.Generator) -> Motion:
    """Reach to the centre of the table with one hand now and then."""
    on = gesture_envelope(time, rng, hold=0.8, rest=1.2, raised=1.0)
    aside, far = rng.uniform(-0.12, 0.12), rng.uniform(0.7, 1.0)
    side, _ = draw_side(rng)
    other = OTHER[side]
    motion = partners.lean_forward(motion, 4.0 + 14.0 * on)
    motion = _lay(mover, motion, place, other, _rest(mover, other, len(time)))
    at = _rest(mover, side, len(time))
    target = np.array([far * (place.middle - place.edge), aside, 0.05])
    at = at + on[:, None] * (target - at) + (4 * on * (1 - on))[:, None] * [0.0, 0.0, 0.06]
    return _lay(mover, motion, place, side, at)


_Task = Callable[[Kinematics, Motion, _Place, Floats, np.random.Generator], Motion]
_TASKS: tuple[_Task, ...] = (_talk, _write, _reach)
