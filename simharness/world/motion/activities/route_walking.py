"""Walking along a route: steps that shorten to a stop, turns on the spot by small steps, and standing in between.

The gait is that of ``round_loops.py``. Its amplitudes follow the speed, so that a person who stops ends in quiet
standing, while the cadence is kept: a slow step is a short one. Steps are in proportion to the legs. The height of the
pelvis follows the feet: high over a standing person, lower while steps are long. A footprint lies where the pelvis
passes over it; a foot is lifted only in a stride that moves its footprint.

Activities: "visit", coming in, walking from place to place, and going out again; and "hide", walking through a booth
with curtains, in which no camera sees the person for a while.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import minimum_filter1d

from mvpose.arrays import Floats
from simharness.scenario.sections.people_section import PeopleSection
from simharness.types.random_streams import stream
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activities.gait import (
    PHASES,
    TOE_OUT,
    Gait,
    make_gait,
    similar_walk_ratio,
    walking_posture,
)
from simharness.world.motion.activity_registry import Activity, solo, solo_activity
from simharness.world.motion.motion import Motion, Performance, Prop
from simharness.world.motion.paths import Itinerary, Route, Spot, turning_time
from simharness.world.motion.poses.foot_placement import Footprints, spot_to_world
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, follow_shank, pelvis_height, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import blend, relaxed_posture, smoothstep

LOOKAHEAD = 3.0
"""Seconds for which a route must be known beyond the last time: poses depend on the steps that follow."""

_STRAIGHTEST = np.radians(7.0)
_STEP_WIDTH = 0.7  # lateral distance of the feet relative to the neutral stance; 0.55 in a steady walk
_WITHIN = 0.3  # of a stride: time in which the height of the pelvis follows the legs; two steps are 0.5 apart
# Degrees by which a person who passes close to another turns the shoulders.
_GIVE_WAY = {"thorax_rotation": 22.0, "lumbar_rotation": 9.0}
_NARROW = {"shoulder_abduction": 0.0, "shoulder_rotation": 30.0, "elbow_flexion": 15.0}
_GIVE_WAY_PELVIS, _GIVE_WAY_TOES = np.radians(32.0), np.radians(12.0)


def walk_route(
    kinematics: Kinematics,
    route: Route,
    time: Floats,
    *,
    rng: np.random.Generator,
    pace: float = 1.0,
    yielding: Callable[[Floats], Floats] = np.zeros_like,
) -> Motion:
    """Walk along a route.

    Args:
        kinematics: body.
        route: places, headings and speeds.
        time: times in seconds, (T,).
        rng: random generator for phase and manner.
        pace: as for ``make_gait``.
        yielding: function of times (n,) that returns how far the shoulders are turned to let someone pass, (n,), -1 to
            1; positive brings the right shoulder forward.
    """
    ratio = similar_walk_ratio(kinematics.leg_length)
    gait = make_gait(kinematics, speed=route.speed, pace=pace, walk_ratio=ratio)
    offset, swing, manner, droop = rng.uniform(size=4)
    resting = relaxed_posture(time, rng)
    turned = yielding(time)
    arms = (0.7 + 0.6 * swing) * gait.vigour
    lean = 1.0 + 4.0 * manner

    def phase(time: Floats) -> Floats:
        return offset + gait.frequency * time

    def feet_facing(time: Floats) -> Floats:
        return route.heading(time) + _GIVE_WAY_TOES * yielding(time)

    width = _STEP_WIDTH * kinematics.legs["left"].end[1]
    steps = {
        side: RouteSteps(route, gait, side, phase, feet_facing, width, late=late)
        for side, late in zip(SIDES, (0.0, 0.5), strict=True)
    }

    def stances(time: Floats) -> tuple[Pelvis, dict[str, Foot]]:
        facing = route.heading(time) + _GIVE_WAY_PELVIS * yielding(time)
        pelvis = gait.pelvis(route.position(time), facing, phase(time), amplitude=briskness(route, time))
        return pelvis, {side: each.foot(time, each.pitch(time)) for side, each in steps.items()}

    pelvis, _ = stances(time)
    narrow = 1.0 - 0.7 * np.abs(turned)  # arms swing less and hang closer in a narrow place
    curves = dict(resting)
    posture = walking_posture(gait, phase(time), arms=narrow * arms, lean=lean, droop=droop)
    blend(curves, briskness(route, time), **posture)
    blend(curves, np.abs(turned), **_NARROW)
    listed = np.degrees(pelvis.list)
    curves["lumbar_bending"], curves["thorax_bending"] = 0.6 * listed, 0.4 * listed
    for name, most in _GIVE_WAY.items():
        curves[name] = curves[name] + most * turned
    seen = sum(_GIVE_WAY.values()) + np.degrees(_GIVE_WAY_PELVIS)
    curves["neck_rotation"] = curves["neck_rotation"] - seen * turned  # the face looks ahead
    height = following_height(kinematics, stances, time, straightest=_STRAIGHTEST, within=_WITHIN / gait.frequency)
    feet = {}
    for side, each in steps.items():
        foot = partial(each.foot, time)
        feet[side] = foot(follow_shank(kinematics, side, pelvis, height, each.pitch(time), foot))
    return solve_legs(kinematics, time, pelvis, height, feet, curves)


_FULL_STEP = 0.12  # metres: a shorter step is lifted less
_FLAT_LIFT = 0.01  # metres
_TURNED = 0.25  # metres per radian: step that counts for a turn of a foot
_RECENT = (0.45, 0.15)  # seconds before and after a moment


def briskness(route: Route, time: Floats) -> Floats:
    """Return the speed at times (T,) relative to the usual one, 0 to 1."""
    return np.minimum(np.linalg.norm(route.velocity(time), axis=-1) / route.speed, 1.0)


def recent_briskness(route: Route, time: Floats) -> Floats:
    """Return the mean speed around times (T,), mostly before them, relative to the usual one, 0 to 1.

    A foot rolls by how far the pelvis has moved over it, not by the speed at the moment: someone who stops between two
    steps still has a foot behind.
    """
    before, after = _RECENT
    moved = np.linalg.norm(route.position(time + after) - route.position(time - before), axis=-1)
    return np.minimum(moved / ((before + after) * route.speed), 1.0)


@dataclass(frozen=True)
class RouteSteps:
    """Steps of one foot along a route."""

    route: Route
    """Places, headings and speeds."""
    gait: Gait
    """Motion of a foot during a stride."""
    side: str
    """Side of the foot."""
    phase: Callable[[Floats], Floats]
    """Function of times (n,) that returns the number of strides of the left foot so far, (n,)."""
    facing: Callable[[Floats], Floats]
    """Function of times (n,) that returns the direction in which the feet point, (n,) radians."""
    width: float
    """Lateral distance of the footprints from the route, metres."""
    late: float
    """Fraction of the stride by which the foot is later than the left one."""

    def pitch(self, time: Floats) -> Floats:
        """Return the pitch of the foot at times (T,) of the usual gait, toes up positive, (T,) radians."""
        pitch, _, _ = self.gait.foot(self.phase(time) - self.late)
        return pitch * recent_briskness(self.route, time)

    def foot(self, time: Floats, pitch: Floats) -> Foot:
        """Return the motion of the foot from footprint to footprint at times (T,) with pitches (T,) in radians."""
        phase = self.phase(time) - self.late
        part = np.mod(phase, 1.0)
        struck = time - part / self.gait.frequency
        prints, following = self._prints(struck), self._prints(struck + 1.0 / self.gait.frequency)
        step = np.linalg.norm(following.ankle - prints.ankle, axis=-1)
        step = step + _TURNED * np.abs(following.bearing - prints.bearing)
        lift = self._lift(part, step, pitch, time)
        _, _, progress = self.gait.foot(phase)
        return prints.to(following, progress=progress, pitch=pitch, lift=lift, rolling=self.gait.rolling)

    def _prints(self, when: Floats) -> Footprints:
        """Return the footprint of a landing at times (T,).

        The pelvis passes over it. While the person turns, the foot points where the pelvis does in the middle of the
        stance, so that the hip rotates as far inward before as outward after it.
        """
        gait, outward = self.gait, 1.0 if self.side == "left" else -1.0
        place = self.route.position(when + gait.lead / self.route.speed)
        middle = self.facing(when + gait.foot_off / 2 / gait.frequency)
        return Footprints.beside(place, middle, left=outward * self.width, toes_left=outward * TOE_OUT)

    def _lift(self, part: Floats, step: Floats, pitch: Floats, time: Floats) -> Floats:
        """Return the height of the lowest point of a foot above the floor, (T,) metres, 0 in stance."""
        gait = self.gait
        along = np.maximum(part - gait.foot_off, 0.0) / (1 - gait.foot_off)
        raised = smoothstep((1 - along) / 0.3)
        rounded = smoothstep(along / 0.25) * raised * gait.rolling.spare(pitch)
        # A foot that does not roll off its toes is raised sooner and higher.
        flat = _FLAT_LIFT * (1.0 - briskness(self.route, time)) * smoothstep(along / 0.3) * raised
        lift = rounded + smoothstep(step / _FULL_STEP) * (np.interp(part, PHASES, gait.lift) + flat)
        return np.where(part > gait.foot_off, lift, 0.0)


_SAMPLES = 8  # from knot to knot of the spline

Stances = Callable[[Floats], tuple[Pelvis, Mapping[str, Foot]]]
"""Motion of pelvis and feet at times (T,) in seconds."""


def following_height(
    kinematics: Kinematics, stances: Stances, time: Floats, *, straightest: float, within: float
) -> Floats:
    """Return the greatest smooth height of the pelvis at which no knee flexes less than ``straightest``, (T,) metres.

    A cubic B-spline is a mean of those of its coefficients whose knots are near. Each coefficient is the lowest height
    that the legs allow near its knot, so the mean is nowhere higher than the legs allow. Where the legs allow the same
    height once in every ``2 * within`` seconds, as at the steps of a walk, the height is constant. It depends on the
    stances up to ``2 * within`` seconds away, and on no other times of ``time``.

    Args:
        kinematics: body.
        stances: motion of pelvis and feet; the height is that without the ``bob`` of the pelvis.
        time: times in seconds, (T,).
        straightest: smallest flexion of a knee, radians.
        within: time in which the height follows the legs, seconds.
    """
    if not len(time):
        return np.zeros(0)
    apart = within / 2  # between knots, of which the two on either side count
    first, last = int(np.floor(time.min() / apart)) - 2, int(np.ceil(time.max() / apart)) + 2
    reach = 2 * _SAMPLES
    sampled: Floats = np.arange(first * _SAMPLES - reach, last * _SAMPLES + reach + 1, dtype=float) * (apart / _SAMPLES)
    pelvis, feet = stances(sampled)
    turn = pelvis.turn.as_matrix()
    allowed = [pelvis_height(kinematics, side, pelvis.ground, turn, feet[side].ankle, straightest) for side in SIDES]
    lowest = minimum_filter1d(np.min(allowed, axis=0) - pelvis.bob, 2 * reach + 1)[reach:-reach:_SAMPLES]
    knots = np.arange(first - 2, last + 3) * apart
    return np.asarray(BSpline(knots, lowest, 3)(time))


@solo_activity("visit", track=Route)
def visit(mover: Kinematics, route: Route, time: Floats, *, rng: np.random.Generator, pace: float) -> Performance:
    """Walk along a route and stand where it stops; absent where the route is outside of the room."""
    return Performance((walk_route(mover, route, time, rng=rng, pace=pace),), presence=(route.presence,))


_DEPTH, _WIDTH = 1.4, 1.1  # metres: size of the booth, along the way and across
_STRIDE = 0.3  # metres from the pelvis to the foremost part of a walking body, which must be behind the curtain
_OVER_HEAD = 0.25  # metres between the top of the head and the roof
_ENDS = 1.45  # metres from the middle of the booth to the places where people turn
_FROUDE = 0.33
_GRAVITY = 9.81
_REST = (0.3, 2.0)  # seconds of standing beside the booth
_HIDDEN = PeopleSection().hidden


def _configured(each: Activity, people: PeopleSection) -> Activity:
    return replace(each, perform=solo(partial(hide, hidden=people.hidden)))


@solo_activity("hide", clearance=_ENDS, configured=_configured)
def hide(
    mover: Kinematics, spot: Spot, time: Floats, *, rng: np.random.Generator, pace: float, hidden: float = _HIDDEN
) -> Performance:
    """Walk through the booth, turn round on the other side, and come back, again and again."""
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
    size = (_DEPTH, _WIDTH, round(mover.body.stature + _OVER_HEAD, 2))
    return Performance((motion,), (Prop.at_rest("booth", size, spot.place, spot.bearing),))
