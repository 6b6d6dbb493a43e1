"""Walking along a route: steps that shorten to a stop, turns on the spot by small steps, and standing in between.

The gait is that of ``walking.py``. Its amplitudes follow the speed, so that a person who stops ends in quiet standing,
while the cadence is kept: a slow step is a short one. A foot is lifted only in a stride that moves its footprint.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activities.gait import Gait, make_gait
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, pose_angles, solve_standing
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.posture import blend, relaxed_posture
from simharness.world.motion.poses.timing import smoothstep
from simharness.world.motion.routes import Route

_STRAIGHTEST = np.radians(5.0)
_TOE_OUT = np.radians(7.0)
_STEP_WIDTH = 0.7  # lateral distance of the feet relative to the neutral stance; 0.55 in a steady walk
_FULL_STEP = 0.12  # metres: a shorter step is lifted less
_RECENT = (0.45, 0.15)  # seconds before and after a moment
_FLAT_LIFT = 0.01  # metres
_TURNED = 0.25  # metres per radian: step that counts for a turn of a foot
_EVERY, _SHIFTS = 0.05, 16  # seconds between samples of the route, and number of stride phases at each
_PELVIS_TURN, _PELVIS_LIST, _PELVIS_SWAY = np.radians(5.0), np.radians(3.5), 0.018  # as in ``walking.py``
_ARM_SWING, _ELBOW_SWING = 19.0, 13.0
# Degrees by which a person who passes close to another turns the shoulders.
_GIVE_WAY = {"thorax_rotation": 22.0, "lumbar_rotation": 9.0}
_NARROW = {"shoulder_abduction": 0.0, "shoulder_rotation": 30.0, "elbow_flexion": 15.0}
_GIVE_WAY_PELVIS = np.radians(32.0)


def walk_route(
    kinematics: Kinematics,
    route: Route,
    time: Floats,
    *,
    rng: np.random.Generator,
    pace: float = 1.0,
    yielding: Callable[[Floats], Floats] = np.zeros_like,
    fit: Floats | None = None,
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
        fit: times whose poses determine the height of the pelvis, (n,); they must not depend on ``time``. None: the
            whole route.
    """
    gait = make_gait(kinematics, speed=route.speed, pace=pace)
    offset, swing, manner, droop = rng.uniform(size=4)
    resting = relaxed_posture(time, rng)
    turned = yielding(time)
    arms = (0.7 + 0.6 * swing) * gait.vigour
    lean = 1.0 + 4.0 * manner
    width = _STEP_WIDTH * kinematics.legs["left"].end[1]

    def stances(time: Floats, phase: Floats) -> tuple[Pelvis, dict[str, Foot]]:
        heading, cycle, brisk = route.heading(time), 2 * np.pi * phase, briskness(route, time)
        aside = _PELVIS_SWAY * brisk * np.sin(cycle - 0.05 * np.pi)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        turned = -_PELVIS_TURN * gait.vigour * brisk * np.cos(cycle) + _GIVE_WAY_PELVIS * yielding(time)
        pelvis = Pelvis(
            ground=route.position(time) + aside[:, None] * left,
            bob=-gait.bob * brisk * np.cos(2 * cycle),
            bearing=heading + turned,
            lean=np.full(len(time), np.radians(1.0)),
            list=_PELVIS_LIST * gait.vigour * brisk * np.cos(cycle - 0.30 * np.pi),
        )
        feet = {
            side: footsteps(route, gait, side, phase - late, time, width=width)
            for side, late in zip(SIDES, (0.0, 0.5), strict=True)
        }
        return pelvis, feet

    phase = offset + gait.frequency * time
    pelvis, feet = stances(time, phase)
    brisk, cycle = briskness(route, time), 2 * np.pi * phase
    counter = 2.0 * np.degrees(-_PELVIS_TURN * gait.vigour * brisk * np.cos(cycle))
    listed = np.degrees(pelvis.list)
    forward = {"left": -np.cos(cycle), "right": np.cos(cycle)}
    narrow = 1.0 - 0.7 * np.abs(turned)  # arms swing less and hang closer in a narrow place
    curves = dict(resting)
    blend(
        curves,
        brisk,
        lumbar_flexion=lean,
        thorax_flexion=lean * 0.6,
        neck_flexion=6.0 * droop - lean,
        neck_rotation=0.5 * counter,
        thorax_rotation=-0.65 * counter,
        **{f"{side}_shoulder_flexion": 1.0 + narrow * arms * (4.0 + _ARM_SWING * forward[side]) for side in SIDES},
        **{f"{side}_shoulder_abduction": 8.0 + 2.0 * droop for side in SIDES},
        **{f"{side}_elbow_flexion": 12.0 + narrow * arms * (10.0 + _ELBOW_SWING * forward[side]) for side in SIDES},
    )
    blend(curves, np.abs(turned), **{f"{side}_{name}": value for side in SIDES for name, value in _NARROW.items()})
    curves["lumbar_bending"], curves["thorax_bending"] = 0.6 * listed, 0.4 * listed
    curves["lumbar_rotation"] = -0.35 * counter * brisk
    for name, most in _GIVE_WAY.items():
        curves[name] = curves[name] + most * turned
    seen = sum(_GIVE_WAY.values()) + np.degrees(_GIVE_WAY_PELVIS)
    curves["neck_rotation"] = curves["neck_rotation"] - seen * turned  # the face looks ahead
    if fit is None:
        start, end = route.span
        fit = np.arange(start - 1.0, end + 1.0, _EVERY)
    shifts = np.arange(_SHIFTS) / _SHIFTS
    samples, phases = np.tile(fit, _SHIFTS), (shifts[:, None] + gait.frequency * fit).ravel()
    return solve_standing(
        kinematics,
        time,
        pelvis,
        feet,
        pose_angles(len(time), **curves),
        straightest=_STRAIGHTEST,
        fit=stances(samples, phases),
    )


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


def footsteps(route: Route, gait: Gait, side: str, phase: Floats, time: Floats, *, width: float) -> Foot:
    """Return the motion of one foot from footprint to footprint.

    Args:
        route: places and headings.
        gait: motion of a foot during a stride.
        side: side of the foot.
        phase: number of strides so far, (T,).
        time: times in seconds, (T,).
        width: lateral distance of the footprints from the route, metres.
    """
    outward = 1.0 if side == "left" else -1.0
    stride = np.floor(phase)
    part = phase - stride
    struck = time - part / gait.frequency

    def prints(when: Floats) -> tuple[Floats, Floats]:
        """Return ankle (T, 2), as if the foot lay flat, and bearing (T,) of the footprint of a landing at ``when``."""
        passed = when + gait.lead / route.speed
        heading = route.heading(passed)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        return route.position(passed) + outward * width * left, heading + outward * _TOE_OUT

    previous, bearing = prints(struck)
    following, following_bearing = prints(struck + 1.0 / gait.frequency)
    step = np.linalg.norm(following - previous, axis=-1) + _TURNED * np.abs(following_bearing - bearing)
    pitch, _, progress = gait.foot(phase)
    brisk = briskness(route, time)
    pitch = pitch * recent_briskness(route, time)
    along = np.maximum(part - gait.foot_off, 0.0) / (1 - gait.foot_off)
    rounded = smoothstep(along / 0.25) * smoothstep((1 - along) / 0.3) * gait.rolling.spare(pitch)
    # A foot that does not roll off its toes is raised sooner and higher.
    flat = _FLAT_LIFT * (1.0 - brisk) * smoothstep(along / 0.3) * smoothstep((1 - along) / 0.3)
    lift = rounded + smoothstep(step / _FULL_STEP) * (np.interp(part, gait.phase, gait.lift) + flat)
    bearing = bearing + progress * (following_bearing - bearing)
    ahead, height = gait.rolling.at(pitch)
    toes = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    ground = previous + progress[:, None] * (following - previous) + ahead[:, None] * toes
    swinging = part > gait.foot_off
    return Foot(np.column_stack([ground, height + np.where(swinging, lift, 0.0)]), bearing, pitch)
