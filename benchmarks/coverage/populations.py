"""Populations of scores of scenes, with their true means."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Floats

Shape = tuple[int, int]
Draw = Callable[[np.random.Generator, Shape], Floats]

_FRAMES = 50


@dataclass(frozen=True)
class ScorePopulation:
    """Scores of scenes: unit, true mean, and samples of a shape."""

    unit: str
    mean: float
    draw: Draw


@dataclass(frozen=True)
class Curve:
    """Scores on a plateau that fall from a value of the factor on, and pass 90 at a later one.

    Attributes:
        plateau: mean on the plateau.
        offset: deviation that all values of a scene share.
        noise: deviation of each value of a scene.
        values: tested values of the factor.
        falls, breaks: values of the factor where the plateau ends, and where the mean passes the threshold.
    """

    plateau: float
    offset: float
    noise: float
    values: tuple[float, ...] = tuple(map(float, range(1, 13)))
    falls: float = 8.0
    breaks: float = 8.3
    threshold: float = 90.0

    def draw(self, rng: np.random.Generator, scenes: int) -> Floats:
        """Return scores (scenes, k)."""
        slope = (self.plateau - self.threshold) / (self.breaks - self.falls)
        mean = self.plateau - np.maximum(np.array(self.values) - self.falls, 0) * slope
        return mean + rng.normal(0, self.offset, (scenes, 1)) + rng.normal(0, self.noise, (scenes, len(mean)))


def clusters(rng: np.random.Generator, shape: tuple[int, ...], rate: float, frames: float) -> Floats:
    """Return numbers of frames with ghosts: ``rate`` ghosts in a scene, each for a geometric number of frames."""
    ghosts = rng.poisson(rate, shape)
    return np.where(ghosts > 0, ghosts + rng.negative_binomial(np.maximum(ghosts, 1), 1 / frames), 0).astype(float)


def _ghosts(rate: float, frames: float) -> ScorePopulation:
    return ScorePopulation(
        "per frame", rate * frames / _FRAMES, lambda rng, shape: clusters(rng, shape, rate, frames) / _FRAMES
    )


def _recall(rate: float, loss: float) -> ScorePopulation:
    """Describe recall of which a share ``rate`` of scenes loses ``loss`` percent on average."""

    def draw(rng: np.random.Generator, shape: Shape) -> Floats:
        return 100 - np.where(rng.random(shape) < rate, 100 * rng.beta(1, 100 / loss - 1, shape), 0.0)

    return ScorePopulation("%", 100 - rate * loss, draw)


def _collapses(rate: float, low: float, high: float, *, seen: bool = False) -> ScorePopulation:
    """Describe PCP of 97 to 100, of which a share ``rate`` of scenes falls to ``low`` to ``high``.

    With ``seen`` a sample without such a scene is drawn again.
    """

    def draw(rng: np.random.Generator, shape: Shape) -> Floats:
        fallen = rng.random(shape) < rate
        while seen and not (found := fallen.any(axis=1)).all():
            fallen[~found] = rng.random((int((~found).sum()), shape[1])) < rate
        return np.where(fallen, rng.uniform(low, high, shape), rng.uniform(97, 100, shape))

    return ScorePopulation("%", rate * (low + high) / 2 + (1 - rate) * 98.5, draw)


MEANS: Mapping[str, ScorePopulation] = {
    "ghosts, 0.08 a scene for 10 frames": _ghosts(0.08, 10),
    "ghosts, 0.3 a scene for 5 frames": _ghosts(0.3, 5),
    "ghosts, 1 a scene for 5 frames": _ghosts(1.0, 5),
    "ghosts, 5 a scene for 3 frames": _ghosts(5.0, 3),
    "a poster in one scene of ten": ScorePopulation(
        "per frame", 0.1, lambda rng, shape: (rng.random(shape) < 0.1).astype(float)
    ),
    "recall, one scene of ten loses 5": _recall(0.1, 5),
    "recall, three scenes of ten lose 5": _recall(0.3, 5),
    "PCP, all scenes lose 2": _recall(1.0, 2),
    "PCP, one scene of ten falls to 40 to 80": _collapses(0.1, 40, 80),
    "the same, samples with such a scene": _collapses(0.1, 40, 80, seen=True),
    "PCP, one scene of five falls to 75 to 85": _collapses(0.2, 75, 85),
    "PCP, half of the scenes fall to 75 to 85": _collapses(0.5, 75, 85),
    "PCP of 60": ScorePopulation("%", 60.0, lambda rng, shape: 100 * rng.beta(3, 2, shape)),
    "errors, log-normal, sigma 0.5": ScorePopulation(
        "mm", math.exp(0.125), lambda rng, shape: rng.lognormal(0, 0.5, shape)
    ),
    "errors, log-normal, sigma 1": ScorePopulation("mm", math.exp(0.5), lambda rng, shape: rng.lognormal(0, 1, shape)),
    "errors, one scene of seven far off": ScorePopulation(
        "mm",
        36.0,
        lambda rng, shape: 30 + rng.normal(0, 3, shape) + (rng.random(shape) < 0.15) * rng.exponential(40, shape),
    ),
}
"""Scores of scenes by name."""

CHANGES: Mapping[str, Draw] = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "Student's t, 3": lambda rng, shape: rng.standard_t(3, shape),
    "exponential": lambda rng, shape: rng.exponential(size=shape) - 1,
    "gamma, 0.5": lambda rng, shape: rng.gamma(0.5, size=shape) - 0.5,
    "log-normal, sigma 1": lambda rng, shape: rng.lognormal(0, 1, shape) - math.exp(0.5),
    "half zero": lambda rng, shape: np.where(rng.random(shape) < 0.5, 0.0, rng.exponential(size=shape)) - 0.5,
}
"""Differences with mean zero by name."""

EVENTS: Mapping[str, Draw] = {
    "single, 5 a scene": lambda rng, shape: rng.poisson(5, (2, *shape)).astype(float),
    "hard and easy scenes": lambda rng, shape: rng.poisson(rng.gamma(0.5, 10, shape), (2, *shape)).astype(float),
    "0.5 ghosts a scene for 5 frames": lambda rng, shape: clusters(rng, (2, *shape), 0.5, 5),
    "2 ghosts a scene for 10 frames": lambda rng, shape: clusters(rng, (2, *shape), 2, 10),
    "20 shared, 0.3 ghosts for 5 frames": lambda rng, shape: (
        rng.poisson(20, shape) + clusters(rng, (2, *shape), 0.3, 5)
    ),
}
"""Counts before and after, with equal rates, by name."""

CURVES: Mapping[str, Curve] = {
    "plateau 92, noise 6": Curve(92, 0, 6),
    "plateau 91, noise 6": Curve(91, 0, 6),
    "plateau 92, scenes 3, noise 3": Curve(92, 3, 3),
    "plateau 95, scenes 5, noise 5": Curve(95, 5, 5),
    "knee between 4 and 8": Curve(97, 4, 4, (0.0, 2.0, 4.0, 8.0), 5.5, 6.0),
    "the same, three values added": Curve(97, 4, 4, (0.0, 2.0, 4.0, 5.0, 6.0, 7.0, 8.0), 5.5, 6.0),
}
"""Curves by name."""
