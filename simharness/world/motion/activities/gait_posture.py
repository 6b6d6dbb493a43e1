"""Posture of a walking person: trunk and head that counter the pelvis, and arms that swing with the opposite legs."""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from simharness.world.motion.activities.gait import Gait
from simharness.world.motion.poses.posture import Curves

# Degrees at full vigour, after Murray, Sepic and Barnard, Phys. Ther. 47, 1967.
_ARM_SWING = 19.0
_ELBOW_SWING = 13.0


def walking_posture(gait: Gait, phase: Floats, *, arms: Floats | float, lean: float, droop: float) -> Curves:
    """Return the curves of trunk, head and arms in degrees by degree of freedom, each (T,) or constant.

    Args:
        gait: stride of the body.
        phase: number of strides of the left foot so far, (T,).
        arms: amplitude of the arms, (T,) or constant.
        lean: lean of the trunk, degrees.
        droop: how far the head hangs and the arms are held away, 0 to 1.
    """
    cycle = 2 * np.pi * phase
    counter = 2.0 * np.degrees(gait.pelvis_turn(phase))  # the thorax rotates opposite to the pelvis
    curves = {
        "lumbar_flexion": np.full(len(phase), lean),
        "thorax_flexion": np.full(len(phase), lean * 0.6),
        "neck_flexion": np.full(len(phase), 6.0 * droop - lean),
        "lumbar_rotation": -0.35 * counter,
        "thorax_rotation": -0.65 * counter,
        "neck_rotation": 0.5 * counter,
    }
    for side, forward in (("left", -np.cos(cycle)), ("right", np.cos(cycle))):  # with the opposite leg
        curves[f"{side}_shoulder_flexion"] = 1.0 + arms * (4.0 + _ARM_SWING * forward)
        curves[f"{side}_shoulder_abduction"] = np.full(len(phase), 8.0 + 2.0 * droop)
        curves[f"{side}_elbow_flexion"] = 12.0 + arms * (10.0 + _ELBOW_SWING * forward)
    return curves
