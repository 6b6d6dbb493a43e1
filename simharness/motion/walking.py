"""Walking along a loop: footprints beside the way, a pelvis that follows it, arms and trunk that counter the legs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from simharness.humans.anatomy import SIDES
from simharness.motion.gait import Gait, make_gait
from simharness.motion.kinematics import Kinematics
from simharness.motion.motion import Motion
from simharness.motion.paths import Loop
from simharness.motion.posing import Foot, Pelvis, pose_angles, stand_on

Floats = NDArray[np.float64]

_GRAVITY = 9.81
_STRAIGHTEST = np.radians(4.0)
_TOE_OUT = np.radians(7.0)
_STEP_WIDTH = 0.55  # between the feet, as a share of their distance in the neutral stance
# Amplitudes at full vigour: pelvis after Perry and Burnfield, "Gait Analysis", 2010; arms (degrees) after Murray, Sepic
# and Barnard, Phys. Ther. 47, 1967.
_PELVIS_TURN, _PELVIS_LIST, _PELVIS_SWAY = np.radians(5.0), np.radians(3.5), 0.018
_ARM_SWING = 19.0
_ELBOW_SWING = 13.0


def walk(kinematics: Kinematics, loop: Loop, time: Floats, *, rng: np.random.Generator, pace: float = 1.0) -> Motion:
    """Walk round the loop at its speed.

    Feet are planted: a footprint lies where the pelvis passes over it, and the foot rolls over it without slipping
    from heel strike to toe off, so that neither a bend nor the sway of the pelvis drags a foot.

    Args:
        kinematics: the body.
        loop: the way and the speed.
        time: seconds, (T,).
        pace: as in ``make_gait``.
        rng: draws the phase and the manner: how far the arms swing, how the trunk leans.
    """
    gait = make_gait(kinematics, speed=loop.speed, pace=pace)
    offset, swing, manner, droop = rng.uniform(size=4)
    arms = (0.7 + 0.6 * swing) * gait.vigour
    lean_degrees = 1.0 + 4.0 * manner
    phase = offset + gait.frequency * time  # of the left foot; the right is half a stride later

    heading = loop.heading(time)
    bank = np.clip(np.arctan(loop.speed**2 * loop.curvature(time) / _GRAVITY), -0.25, 0.25)  # into the bend
    cycle = 2 * np.pi * phase
    turned = -_PELVIS_TURN * gait.vigour * np.cos(cycle)  # the side that steps goes forward
    listed = _PELVIS_LIST * gait.vigour * np.cos(cycle - 0.30 * np.pi)  # the swinging side drops
    aside = _PELVIS_SWAY * np.sin(cycle - 0.05 * np.pi)  # over the standing foot
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    ground = loop.position(time) + aside[:, None] * left
    lean = np.full(len(time), np.radians(1.0))
    bob = -gait.bob * np.cos(2 * cycle)  # lowest when a heel strikes
    pelvis = Pelvis(ground=ground, bob=bob, bearing=heading + turned, lean=lean, list=listed)
    own = {"left": phase, "right": phase - 0.5}
    feet = {side: _steps(kinematics, loop, gait, side, own[side], time) for side in SIDES}
    counter = 2.0 * np.degrees(turned)  # the thorax turns as far the other way as the pelvis
    forward = {"left": -np.cos(cycle), "right": np.cos(cycle)}  # an arm swings with the leg of the other side
    look = np.degrees(np.clip(0.5 * loop.curvature(time), -0.6, 0.6))  # into the bend
    angles = pose_angles(
        len(time),
        lumbar_flexion=lean_degrees,
        thorax_flexion=lean_degrees * 0.6,
        neck_flexion=6.0 * droop - lean_degrees,
        lumbar_bending=0.6 * np.degrees(listed) + 0.2 * np.degrees(bank),
        thorax_bending=0.4 * np.degrees(listed) + 0.2 * np.degrees(bank),
        lumbar_rotation=-0.35 * counter,
        thorax_rotation=-0.65 * counter,
        neck_rotation=0.5 * counter + look,
        **{f"{side}_shoulder_flexion": 1.0 + arms * (4.0 + _ARM_SWING * forward[side]) for side in forward},
        **{f"{side}_shoulder_abduction": 8.0 + 2.0 * droop for side in forward},
        **{f"{side}_shoulder_rotation": 8.0 for side in forward},
        **{f"{side}_elbow_flexion": 12.0 + arms * (10.0 + _ELBOW_SWING * forward[side]) for side in forward},
        **{f"{side}_forearm_pronation": 15.0 for side in forward},
        **{f"{side}_wrist_flexion": 6.0 for side in forward},
    )
    guess = {side: gait.leg(own[side]) for side in SIDES}
    return stand_on(kinematics, time, pelvis, feet, angles, guess=guess, straightest=_STRAIGHTEST)


def _steps(kinematics: Kinematics, loop: Loop, gait: Gait, side: str, phase: Floats, time: Floats) -> Foot:
    """One foot's way from print to print; ``phase`` counts its strides."""
    width = _STEP_WIDTH * kinematics.legs[side].end[1]  # to the left
    toe_out = _TOE_OUT * np.sign(width)
    stride = np.floor(phase)
    struck = time - (phase - stride) / gait.frequency

    def prints(when: Floats) -> tuple[Floats, Floats]:
        """Ankle (T, 2) over the print, as if flat, and bearing of a foot that lands at ``when``."""
        passed = when + gait.lead / loop.speed  # the pelvis is over the print
        heading = loop.heading(passed)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        return loop.position(passed) + width * left, heading + toe_out

    here, bearing = prints(struck)
    there, bearing_there = prints(struck + 1.0 / gait.frequency)
    pitch, lift, progress = gait.foot(phase)
    swung = np.angle(np.exp(1j * (bearing_there - bearing)))
    bearing = bearing + progress * swung
    ahead, height = gait.rolling.at(pitch)
    toes = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    ground = here + progress[:, None] * (there - here) + ahead[:, None] * toes
    return Foot(ankle=np.column_stack([ground, height + lift]), bearing=bearing, pitch=pitch)
