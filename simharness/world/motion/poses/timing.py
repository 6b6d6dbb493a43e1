"""Curves of time that movements are made of: eased ways between values, repeated rounds, aimless wandering."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats


def ease(x: ArrayLike) -> Floats:
    """0 to 1, clipped, with neither velocity nor acceleration at the ends: minimum jerk (Flash and Hogan, 1985)."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x)


def smoothstep(x: ArrayLike) -> Floats:
    """0 to 1, clipped, with no velocity at either end: quicker to set out than :func:`ease`."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def minimum_jerk(time: Floats, *keys: tuple[float, float]) -> Floats:
    """From value to value, at rest at each, (T,): minimum-jerk ways between keys (time, value), held beyond them."""
    result = np.full(len(time), float(keys[0][1]))
    for (start, before), (end, after) in pairwise(keys):
        if before != after:
            result += (after - before) * ease((time - start) / (end - start))
    return result


def bump(time: Floats, start: float, end: float) -> Floats:
    """0 to 1 and back to 0 between two times, smoothly, (T,)."""
    x = np.clip((time - start) / (end - start), 0.0, 1.0)
    return 64 * x**3 * (1 - x) ** 3


def cycle_time(
    time: Floats, lasting: Sequence[float], *, rng: np.random.Generator, pace: float = 1.0
) -> tuple[Floats, Floats]:
    """Divide time into equal rounds of several parts each.

    Args:
        time: seconds, (T,).
        lasting: about how long each of n parts lasts, seconds.
        rng: varies the parts by a sixth, and where in a round time 0 falls.
        pace: how much quicker than that.

    Returns:
        Seconds since the round began, (T,), and when in a round its parts begin, the first at 0, and the round ends,
        (n + 1,).
    """
    parts = np.asarray(lasting) * rng.uniform(1 - 1 / 6, 1 + 1 / 6, len(lasting)) / pace
    marks = np.concatenate([[0.0], np.cumsum(parts)])
    return np.mod(time + rng.uniform(0.0, marks[-1]), marks[-1]), marks


def smooth_noise(time: Floats, rng: np.random.Generator, rate: float) -> Floats:
    """A smooth aimless curve about 0 within -1..1, (T,): three slow waves about ``rate`` hertz."""
    rates = rate * rng.uniform([0.6, 1.0, 1.7], [0.9, 1.5, 2.4])
    phases = rng.uniform(0.0, 2 * np.pi, 3)
    return np.sin(2 * np.pi * time[:, None] * rates + phases) @ np.array([0.5, 0.3, 0.2])


def gesture_envelope(
    time: Floats, rng: np.random.Generator, *, hold: float, rest: float, raised: float = 0.8
) -> Floats:
    """How far a repeated gesture is on, (T,) from 0 (resting) to 1 (held), smoothly up and down.

    Args:
        time: seconds, (T,).
        rng: varies the timing, and where in the repetition time 0 falls.
        hold: about how long it is held, seconds.
        rest: about how long the arm rests in between, seconds.
        raised: about how long going up and coming down each take, seconds.
    """
    up, held, down, still = np.array([raised, hold, 1.1 * raised, rest]) * rng.uniform(0.8, 1.2, 4)
    period = up + held + down + still
    at = np.mod(time + rng.uniform(0.0, up + 0.5 * held), period)  # never begins with the long rest
    return ease(at / up) * (1 - ease((at - up - held) / down))
