"""Walking along a route: steps that shorten to a stop, turns on the spot by small steps, and standing in between.

The gait is that of ``walking.py``. Its amplitudes follow the speed, so that a person who stops ends in quiet standing,
while the cadence is kept: a slow step is a short one. Steps are in proportion to the legs. The height of the pelvis
follows the feet: it is that of straight legs when a person stands.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activities.gait import make_gait, similar_walk_ratio
from simharness.world.motion.activities.gait_posture import walking_posture
from simharness.world.motion.activities.route_steps import RouteSteps, briskness
from simharness.world.motion.motion import Motion
from simharness.world.motion.poses.heel_rise import follow_shank
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, pose_angles, solve_legs
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.pelvis_height import following_height
from simharness.world.motion.poses.posture import blend, limbs, relaxed_posture
from simharness.world.motion.routes import Route

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
    blend(curves, np.abs(turned), **limbs(**_NARROW))
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
    return solve_legs(kinematics, time, pelvis, height, feet, pose_angles(len(time), **curves))
