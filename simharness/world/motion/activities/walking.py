"""Activity "walk": footprints beside a loop, a pelvis that follows it, and arms and trunk that counter the legs."""

import numpy as np

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activities.gait import TOE_OUT, Gait, make_gait, walking_posture
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Loop
from simharness.world.motion.poses.foot_placement import Footprints
from simharness.world.motion.poses.inverse_kinematics import Foot, Pelvis, solve_standing
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import limbs

_GRAVITY = 9.81
_STRAIGHTEST = np.radians(4.0)
_STEP_WIDTH = 0.55  # lateral distance of the feet relative to the neutral stance
_EVERY, _SHIFTS = 0.03, 9  # seconds between samples of the loop, and number of stride phases at each


@solo_activity("walk", track=Loop)
def walk(kinematics: Kinematics, loop: Loop, time: Floats, *, rng: np.random.Generator, pace: float = 1.0) -> Motion:
    """Walk round the loop at its speed.

    Feet are planted: a footprint lies where the pelvis passes over it, and the foot rolls over it without slipping
    from heel strike to toe-off, so that neither a bend nor the sway of the pelvis drags a foot.
    """
    gait = make_gait(kinematics, speed=loop.speed, pace=pace)
    offset, swing, manner, droop = rng.uniform(size=4)
    arms = (0.7 + 0.6 * swing) * gait.vigour
    lean_degrees = 1.0 + 4.0 * manner
    phase = offset + gait.frequency * time  # left foot; the right foot is half a stride later

    width = _STEP_WIDTH * kinematics.legs["left"].end[1]

    def stances(time: Floats, phase: Floats) -> tuple[Pelvis, dict[str, Foot]]:
        pelvis = gait.pelvis(loop.position(time), loop.heading(time), phase)
        feet = {
            side: footsteps(loop, gait, side, phase - late, time, width=width, toe_out=TOE_OUT)
            for side, late in zip(SIDES, (0.0, 0.5), strict=True)
        }
        return pelvis, feet

    pelvis, feet = stances(time, phase)
    bank = np.clip(np.arctan(loop.speed**2 * loop.curvature(time) / _GRAVITY), -0.25, 0.25)  # into the bend
    curves = walking_posture(gait, phase, arms=arms, lean=lean_degrees, droop=droop)
    curves["lumbar_bending"] = 0.6 * np.degrees(pelvis.list) + 0.2 * np.degrees(bank)
    curves["thorax_bending"] = 0.4 * np.degrees(pelvis.list) + 0.2 * np.degrees(bank)
    look = np.degrees(np.clip(0.5 * loop.curvature(time), -0.6, 0.6))  # into the bend
    curves["neck_rotation"] = curves["neck_rotation"] + look
    posture = curves | limbs(shoulder_rotation=8.0, forearm_pronation=15.0, wrist_flexion=6.0)
    lap, strides = laps(loop, gait)
    return solve_standing(kinematics, time, pelvis, feet, posture, straightest=_STRAIGHTEST, fit=stances(lap, strides))


def laps(loop: Loop, gait: Gait) -> tuple[Floats, Floats]:
    """Return times (n,) of several rounds of the loop, and the phase of the stride at each, (n,).

    Together they sample every place of the loop in every phase of the stride, so that what holds for them holds for a
    walk of any duration.
    """
    once = np.arange(0.0, loop.length / loop.speed, _EVERY)
    shifts = np.arange(_SHIFTS) / _SHIFTS
    return np.tile(once, _SHIFTS), (shifts[:, None] + gait.frequency * once).ravel()


def footsteps(loop: Loop, gait: Gait, side: str, phase: Floats, time: Floats, *, width: float, toe_out: float) -> Foot:
    """Return the motion of one foot from footprint to footprint.

    Args:
        loop: path and speed.
        gait: motion of a foot during a stride.
        side: side of the foot.
        phase: number of strides so far, (T,).
        time: times in seconds, (T,).
        width: lateral distance of the footprints from the path, metres.
        toe_out: outward rotation of the toes, radians.
    """
    outward = 1.0 if side == "left" else -1.0
    stride = np.floor(phase)
    struck = time - (phase - stride) / gait.frequency

    def prints(when: Floats) -> Footprints:
        """Return the footprint of a landing at ``when``."""
        passed = when + gait.lead / loop.speed  # the pelvis is over the print
        return Footprints.beside(
            loop.position(passed), loop.heading(passed), left=outward * width, toes_left=outward * toe_out
        )

    pitch, lift, progress = gait.foot(phase)
    following = prints(struck + 1.0 / gait.frequency)
    return prints(struck).to(following, progress=progress, pitch=pitch, lift=lift, rolling=gait.rolling)
