"""Posture of trunk, head and arms: curves in degrees by degree of freedom."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import SIDES
from simharness.world.motion.poses.timing import smooth_noise

Curves = dict[str, Floats]

_HANGING = {"shoulder_abduction": 9.0, "shoulder_rotation": 8.0, "elbow_flexion": 14.0, "forearm_pronation": 12.0}
_HANGING |= {"wrist_flexion": 5.0, "shoulder_flexion": 2.0}


def relaxed_posture(time: Floats, rng: np.random.Generator) -> Curves:
    """Draw the curves of a relaxed standing person: hanging arms, small head motion, and slow noise in every joint."""
    curves = {
        "neck_rotation": 12.0 * smooth_noise(time, rng, 0.15),
        "neck_flexion": 3.0 + 4.0 * smooth_noise(time, rng, 0.25),
        "neck_bending": 2.0 * smooth_noise(time, rng, 0.2),
        "lumbar_flexion": 1.0 + 1.0 * smooth_noise(time, rng, 0.15),
        "thorax_rotation": 3.0 * smooth_noise(time, rng, 0.12),
    }
    for side in SIDES:
        for name, rest in _HANGING.items():
            curves[f"{side}_{name}"] = rest + 1.5 * smooth_noise(time, rng, 0.2)
    return curves


def blend(curves: Curves, on: Floats, **targets: ArrayLike) -> None:
    """Blend the curves, in place, towards the targets in degrees with the weight ``on`` (T,), 0 to 1."""
    for name, target in targets.items():
        curves[name] = (1 - on) * curves.get(name, np.zeros_like(on)) + on * np.asarray(target, float)


def limb(side: str, **targets: ArrayLike) -> dict[str, ArrayLike]:
    """Return targets of the joints of one side, given by names without the side."""
    return {f"{side}_{name}": value for name, value in targets.items()}


def limbs(**targets: ArrayLike) -> dict[str, ArrayLike]:
    """Return the same targets for the joints of both sides, given by names without the side."""
    return {name: value for side in SIDES for name, value in limb(side, **targets).items()}


def draw_side(rng: np.random.Generator) -> tuple[str, float]:
    """Draw the side of the active arm, right with probability 0.75, and its sign: 1 left, -1 right."""
    side = "right" if rng.uniform() < 0.75 else "left"
    return side, 1.0 if side == "left" else -1.0
