"""Drawing adults whose statures are spread as published."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from simharness.humans.body import body_model
from simharness.humans.shape import Shape

# Mean and standard deviation of adult stature, metres, men and women: those born around 1996 in high-income
# countries, NCD Risk Factor Collaboration, "A century of trends in adult human height", eLife 5, 2016.
STATURE = {"male": (1.76, 0.07), "female": (1.63, 0.065)}
# Mean and standard deviation of anny's weight. Even its heaviest adults are lean: these give a body mass index of
# 23 +- 1.4 (men) and 21 +- 1.6 kg/m2 (women), where the published means are 25 to 27.
WEIGHT = {"male": (0.65, 0.2), "female": (0.75, 0.18)}
_SPREAD = 2.5  # standard deviations at which the tails are cut


def draw_shape(rng: np.random.Generator) -> Shape:
    """Draw an adult: either sex alike, of any age, most of average build."""
    female = rng.random() < 0.5
    mean, deviation = STATURE["female" if female else "male"]
    stature = mean + deviation * np.clip(rng.normal(), -_SPREAD, _SPREAD)
    gender = np.clip((1 - 0.05 if female else 0.05) + 0.05 * rng.normal(), 0, 1)
    shape = Shape(
        gender=float(gender),
        age=float(rng.uniform(2 / 3, 0.92)),
        muscle=float(np.clip(rng.normal(0.5, 0.15), 0.2, 0.9)),
        weight=float(np.clip(rng.normal(*WEIGHT["female" if female else "male"]), 0.2, 1.0)),
        proportions=float(rng.uniform(0.2, 0.8)),
    )
    return with_stature(shape, float(stature))


def with_stature(shape: Shape, stature: float) -> Shape:
    """The same shape with the height that makes it ``stature`` metres tall.

    Raises:
        ValueError: a stature that no height reaches.
    """

    def reach(height: float) -> float:
        return body_model().stature(asdict(shape) | {"height": height})

    low, high = 0.0, 1.0
    least, greatest = reach(low), reach(high)
    if not least <= stature <= greatest:
        raise ValueError(f"a stature of {stature:.3g} m is beyond this shape's {least:.3f} to {greatest:.3f} m")
    # Vertices are linear in height; which of them is the lowest changes, so one secant is nearly enough.
    height = 0.5
    for _ in range(20):
        height = low + (high - low) * (stature - least) / (greatest - least)
        reached = reach(height)
        if abs(reached - stature) < 1e-5:
            break
        if reached < stature:
            low, least = height, reached
        else:
            high, greatest = height, reached
    return replace(shape, height=height)
