"""Activities "walk" and "run": footprints beside a loop, a pelvis that follows it, and arms that counter the legs.

The sagittal angles of a runner's hip, knee and ankle pass through the landmarks that T. F. Novacheck gives for a runner
at about 3 m/s ("The biomechanics of running", Gait and Posture 7, 1998: toe-off at 39 % of the stride; knee flexion of
about 40 degrees in stance and 90 in swing, hip flexion from 45 to -7, ankle dorsiflexion from 20 to -20). Between the
landmarks they are smooth curves. Slower runners use the same curves with a smaller amplitude.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.activities.gait import PHASES, RUN, TOE_OUT, Gait, make_gait, walking_posture
from simharness.world.motion.activity_registry import solo_activity
from simharness.world.motion.motion import Motion
from simharness.world.motion.paths import Loop
from simharness.world.motion.poses.foot_placement import Footprints, leftward
from simharness.world.motion.poses.inverse_kinematics import Feet, Foot, Pelvis, solve_standing
from simharness.world.motion.poses.kinematics import Kinematics
from simharness.world.motion.poses.timing import ease, limbs

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

    def stances(time: Floats, phase: Floats) -> tuple[Pelvis, Feet]:
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


_CADENCE = 1.2  # strides per second at pace 1 with legs 0.85 m long; scales with leg length as a pendulum does
_LEG = 0.85
_VIGOUR = (0.15, 1.5)  # range of amplitudes, relative to the curves, in which a stride is sought
_EARLY = 0.07  # fraction of the stride by which feet land nearer; otherwise the leg would be too short at foot strike
_CLEARANCE = 0.12  # clearance of the swinging foot, in leg lengths
_MIDSTANCE = 0.19  # fraction of the stride at which the pelvis is lowest
_FLATTENED = 0.6
_RUN_BENT = np.radians(8.0)  # smallest knee flexion of a runner
_WIDTH = 0.25  # lateral distance of the footprints relative to the neutral stance


@solo_activity("run", track=Loop, froude=(0.6, 0.95))
def run(kinematics: Kinematics, loop: Loop, time: Floats, *, rng: np.random.Generator, pace: float = 1.0) -> Motion:
    """Run round the loop at its speed."""
    stride = make_stride(kinematics, speed=loop.speed, pace=pace)
    offset, swing, upright, droop = rng.uniform(size=4)
    vigour = min(stride.vigour, 1.1)

    def stances(time: Floats, phase: Floats) -> tuple[Pelvis, Feet]:
        cycle = 2 * np.pi * phase
        heading = loop.heading(time)
        aside = 0.012 * np.sin(cycle + 0.1 * np.pi)
        pelvis = Pelvis(
            ground=loop.position(time) + aside[:, None] * leftward(heading),
            bob=-stride.bob * np.cos(2 * (cycle - 2 * np.pi * _MIDSTANCE)),
            bearing=heading - np.radians(6.0) * vigour * np.cos(cycle),
            lean=np.full(len(time), np.radians(4.0 + 3.0 * upright)),
            list=np.radians(3.5) * vigour * np.sin(cycle + 0.1 * np.pi),
        )
        width = _WIDTH * kinematics.legs["left"].end[1]
        feet = {
            side: footsteps(loop, stride, side, phase - late, time, width=width, toe_out=np.radians(5.0))
            for side, late in zip(SIDES, (0.0, 0.5), strict=True)
        }
        return pelvis, feet

    phase = offset + stride.frequency * time  # left foot
    pelvis, feet = stances(time, phase)
    cycle = 2 * np.pi * phase
    forward = {"left": -np.cos(cycle - 0.1 * np.pi), "right": np.cos(cycle - 0.1 * np.pi)}  # with the opposite leg
    arms = (0.75 + 0.5 * swing) * (0.5 + 0.5 * vigour)
    turned = np.degrees(pelvis.bearing - loop.heading(time))
    leaning = np.arctan(loop.speed**2 * loop.curvature(time) / _GRAVITY)  # into the bend, positive to the left
    bank = np.degrees(np.clip(leaning, -0.3, 0.3))
    posture: dict[str, ArrayLike] = dict(
        lumbar_flexion=3.0,
        thorax_flexion=3.0,
        neck_flexion=-6.0 + 4.0 * droop,
        lumbar_rotation=-0.6 * turned,
        thorax_rotation=-1.4 * turned,
        neck_rotation=1.0 * turned + np.degrees(np.clip(0.5 * loop.curvature(time), -0.5, 0.5)),
        lumbar_bending=np.degrees(pelvis.list) * 0.5 + 0.4 * bank,
        thorax_bending=np.degrees(pelvis.list) * 0.3 + 0.3 * bank,
        **{f"{side}_shoulder_flexion": -8.0 + 32.0 * arms * forward[side] for side in SIDES},
        **{f"{side}_shoulder_abduction": 12.0 + 6.0 * droop for side in SIDES},
        **{f"{side}_shoulder_rotation": 22.0 + 8.0 * forward[side] for side in SIDES},
        **{f"{side}_elbow_flexion": 88.0 + 12.0 * arms * forward[side] for side in SIDES},
        **{f"{side}_forearm_pronation": 5.0 for side in SIDES},
        **{f"{side}_clavicle_elevation": 3.0 for side in SIDES},
    )
    lap, strides = laps(loop, stride)
    return solve_standing(kinematics, time, pelvis, feet, posture, straightest=_RUN_BENT, fit=stances(lap, strides))


def make_stride(kinematics: Kinematics, *, speed: float, pace: float = 1.0) -> Gait:
    """Return the running stride of a body at a speed: cadence by leg length, amplitude of the curves by stride length.

    Args:
        kinematics: body.
        speed: speed in metres per second.
        pace: cadence relative to the usual one.

    Raises:
        ValueError: this body does not run at this speed.
    """
    frequency = _CADENCE * pace * float(np.sqrt(_LEG / kinematics.leg_length))
    stride = speed / frequency
    least, most = (_swept(kinematics, vigour) for vigour in _VIGOUR)
    if not least < RUN.foot_off * stride < most:
        low, high = (swept / RUN.foot_off * frequency for swept in (least, most))
        raise ValueError(
            f"a person {kinematics.body.stature:.2f} m tall runs at {low:.2f} to {high:.2f} m/s, not at {speed:g} m/s"
        )
    vigour = float(brentq(lambda v: _swept(kinematics, v) - RUN.foot_off * stride, *_VIGOUR, xtol=1e-5))
    pitch, print_x = RUN.play(kinematics, vigour)
    stance = RUN.foot_off >= PHASES
    lead = float(np.mean(print_x[stance] + stride * PHASES[stance])) - _EARLY * stride
    # A sine wave with two periods per stride, highest in flight. With the acceleration g at its top its amplitude would
    # be g / (4 pi frequency)²; the flight is short, so the amplitude is reduced.
    bob = _FLATTENED * _GRAVITY / (4 * np.pi * frequency) ** 2
    along = np.maximum(PHASES - RUN.foot_off, 0.0) / (1 - RUN.foot_off)
    lift = _CLEARANCE * vigour * kinematics.leg_length * ease(along / 0.38) * ease((1 - along) / 0.36)
    progress = RUN.progress(print_x, stride=stride, lead=lead)
    return Gait(stride, frequency, vigour, bob, lead, pitch, lift, progress, RUN.foot_off, kinematics.rolling)


def _swept(kinematics: Kinematics, vigour: float) -> float:
    """Return the distance that the pelvis moves over a planted foot, metres."""
    _, print_x = RUN.play(kinematics, vigour)
    return float(print_x[0] - np.interp(RUN.foot_off, PHASES, print_x))
