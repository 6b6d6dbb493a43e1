"""Curves of movements over time: minimum-jerk transitions, cyclic time, envelopes of gestures, noise, and postures.

A posture is that of trunk, head and arms: curves in degrees by degree of freedom.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.world.humans.anatomy import ANATOMY, SIDES


def ease(x: ArrayLike) -> Floats:
    """Return the minimum-jerk transition from 0 to 1 (Flash and Hogan, 1985) at x, clipped to 0..1.

    Velocity and acceleration are zero at both ends.
    """
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x)


def smoothstep(x: ArrayLike) -> Floats:
    """Return the cubic transition from 0 to 1 at x, clipped to 0..1; it starts faster than :func:`ease`.

    Velocity is zero at both ends.
    """
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def minimum_jerk(time: Floats, *keys: tuple[float, float]) -> Floats:
    """Return minimum-jerk transitions between keys (time, value), (T,); at rest at each key, constant beyond them."""
    result = np.full(len(time), float(keys[0][1]))
    for (start, before), (end, after) in pairwise(keys):
        if before != after:
            result += (after - before) * ease((time - start) / (end - start))
    return result


def bump(time: Floats, start: float, end: float) -> Floats:
    """Return a smooth pulse, (T,), that rises from 0 to 1 and falls back to 0 between two times."""
    x = np.clip((time - start) / (end - start), 0.0, 1.0)
    return 64 * x**3 * (1 - x) ** 3


def cycle_time(
    time: Floats, lasting: Sequence[float], *, rng: np.random.Generator, pace: float = 1.0
) -> tuple[Floats, Floats]:
    """Divide time into equal cycles of several parts each.

    Args:
        time: times in seconds, (T,).
        lasting: mean durations of the n parts in seconds.
        rng: random generator; varies the durations by up to a sixth, and the phase of time 0.
        pace: speed relative to these durations.

    Returns:
        Seconds since the start of the cycle, (T,), and the start times of the parts in a cycle, the first at 0,
        followed by the end of the cycle, (n + 1,).
    """
    parts = np.asarray(lasting) * rng.uniform(1 - 1 / 6, 1 + 1 / 6, len(lasting)) / pace
    marks = np.concatenate([[0.0], np.cumsum(parts)])
    return np.mod(time + rng.uniform(0.0, marks[-1]), marks[-1]), marks


def smooth_noise(time: Floats, rng: np.random.Generator, rate: float) -> Floats:
    """Draw smooth noise about 0 within -1..1, (T,): a sum of three sine waves of about ``rate`` hertz."""
    rates = rate * rng.uniform([0.6, 1.0, 1.7], [0.9, 1.5, 2.4])
    phases = rng.uniform(0.0, 2 * np.pi, 3)
    return np.sin(2 * np.pi * time[:, None] * rates + phases) @ np.array([0.5, 0.3, 0.2])


def gesture_envelope(
    time: Floats, rng: np.random.Generator, *, hold: float, rest: float, raised: float = 0.8
) -> Floats:
    """Draw the envelope of a repeated gesture, (T,), smooth between 0 (rest) and 1 (hold).

    Args:
        time: times in seconds, (T,).
        rng: random generator; varies the durations, and the phase of time 0.
        hold: mean duration of the hold in seconds.
        rest: mean duration of the rest between two gestures in seconds.
        raised: mean duration of raising and of lowering in seconds.
    """
    up, held, down, still = np.array([raised, hold, 1.1 * raised, rest]) * rng.uniform(0.8, 1.2, 4)
    period = up + held + down + still
    at = np.mod(time + rng.uniform(0.0, up + 0.5 * held), period)  # time 0 is never in the long rest
    return ease(at / up) * (1 - ease((at - up - held) / down))


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


def blend(curves: Curves, on: Floats, side: str = "", /, **targets: ArrayLike) -> None:
    """Blend the curves, in place, towards the targets in degrees with the weight ``on`` (T,), 0 to 1.

    Hinges of limbs may be named without their side: they are those of ``side``, or by default of both.
    """
    for name, target in targets.items():
        sided = [f"{each}_{name}" for each in ((side,) if side else SIDES)]
        for curve in sided if name in ANATOMY["limbs"] else (name,):
            curves[curve] = (1 - on) * curves.get(curve, np.zeros_like(on)) + on * np.asarray(target, float)


def limbs(**targets: ArrayLike) -> dict[str, ArrayLike]:
    """Return the same targets for the joints of both sides, given by names without the side."""
    return {f"{side}_{name}": value for side in SIDES for name, value in targets.items()}


def draw_side(rng: np.random.Generator) -> tuple[str, float]:
    """Draw the side of the active arm, right with probability 0.75, and its sign: 1 left, -1 right."""
    side = "right" if rng.uniform() < 0.75 else "left"
    return side, 1.0 if side == "left" else -1.0
