"""Things that come and go by themselves: when each is born and how long it lasts."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import pdtr

from mvpose.arrays import Floats, Integers
from simharness.detector.correlation import Chances, Key
from simharness.types.random_streams import stream

_LAYER = 0.25  # alive at once, on average: births are drawn in layers of so many, as many as the rate needs
_COUNTS = np.arange(20)  # births of a layer in a frame; more have a chance of 1e-29


@dataclass(frozen=True)
class Lives:
    """Births and deaths: n things that are there from one frame to another.

    Of every layer as many are alive in each frame, the first among them, as a Poisson number says, and of those each
    lives on by itself for an exponential time. That is the queue M/M/∞ at the frames' times, and with no life at all
    independent frames. Rates are reached by leaving out: what is there at a rate is there at a higher one.

    Attributes:
        chances: the sequence and its seed.
        key: names the things; draws about them go by it.
        life: mean seconds; 0: each is there in one frame.
        most: the highest rate to be drawn, mean number at a time.
    """

    chances: Chances
    key: tuple[Key, ...]
    life: float
    most: float

    @property
    def born(self) -> Integers:
        """The frame in which each is there for the first time, (n,)."""
        return np.concatenate([np.zeros(0, int), *self._births])

    @cached_property
    def last(self) -> Integers:
        """The frame in which each is there for the last time, (n,)."""
        more = self.life / self.chances.step
        lasting = np.minimum(more * self._drawn("life", (), np.random.Generator.standard_exponential), 1e9)
        return np.minimum(self.born + lasting.astype(int), len(self.chances.time) - 1)

    @cached_property
    def mark(self) -> Floats:
        """Above which rate each is there, (n,)."""
        layer = np.repeat(np.arange(len(self._births)), [len(births) for births in self._births])
        return _LAYER * (layer + self.uniform("mark"))

    @cached_property
    def number(self) -> Integers:
        """A number for each, (n,), that goes with it whatever else is drawn."""
        return np.concatenate([np.zeros(0, int), *(np.arange(len(b)) + 5 * k for k, b in enumerate(self._births))])

    @cached_property
    def name(self) -> Integers:
        """A number for each, (n,), that no other thing has, of this key or another; whatever else is drawn.

        Of 53 random bits: among a million things two share one with a chance of 1 in 18000.
        """
        return (2.0**53 * self.uniform("name")).astype(np.int64)

    def normal(self, purpose: str, *shape: int) -> Floats:
        """Standard normal draws about each, (n, ...)."""
        return self._drawn(purpose, shape, np.random.Generator.standard_normal)

    def uniform(self, purpose: str, *shape: int) -> Floats:
        """Uniform draws about each, (n, ...)."""
        return self._drawn(purpose, shape, np.random.Generator.random)

    @cached_property
    def _births(self) -> list[Integers]:
        """Of each layer the frames of birth, rising."""
        frames = np.arange(len(self.chances.time))
        mean = _LAYER * (-np.expm1(-self.chances.step / self.life) if self.life else 1.0)
        later, first = pdtr(_COUNTS, mean), pdtr(_COUNTS, _LAYER)
        births = []
        for layer in range(int(np.ceil(self.most / _LAYER))):
            draws = self._stream("births", layer).random(len(frames))
            count = np.searchsorted(later, draws)
            count[:1] = np.searchsorted(first, draws[:1])
            births.append(np.repeat(frames, count))
        return births

    def _drawn(
        self, purpose: str, shape: tuple[int, ...], draw: Callable[[np.random.Generator, tuple[int, ...]], Floats]
    ) -> Floats:
        draws = [draw(self._stream(purpose, k), (len(births), *shape)) for k, births in enumerate(self._births)]
        return np.concatenate([np.zeros((0, *shape)), *draws])

    def _stream(self, purpose: str, layer: int) -> np.random.Generator:
        return stream(self.chances.seed, "detector", *self.key, purpose, layer)


def alive(born: Integers, last: Integers) -> tuple[Integers, Integers]:
    """All (r,) pairs of a thing and a frame in which it is there: its index, and the frame."""
    count = last - born + 1
    thing = np.repeat(np.arange(len(born)), count)
    return thing, born[thing] + np.arange(len(thing)) - np.repeat(np.cumsum(count) - count, count)


def anew(chances: Chances, *key: Key, number: Integers, frame: Integers, size: int) -> Floats:
    """Standard normal numbers for the joints of things, new in every frame, (r, 17, size).

    A block of the frames serves all things: each begins at another of its joints.

    Args:
        chances: of the sequence.
        key: names the draws.
        number: of the things, (r,).
        frame: in which they are there, (r,).
        size: of numbers for each joint.
    """
    block = chances.normal(*key, "anew", shape=(17, size))
    return block[frame[:, None], (np.arange(17) + number[:, None]) % 17]


def slots(born: Integers, last: Integers) -> Integers:
    """A slot for each, (n,), for as long as it lasts: the first that is free."""
    taken: list[tuple[int, int]] = []
    free: list[int] = []
    result = np.zeros(len(born), int)
    for thing in np.argsort(born, kind="stable").tolist():
        while taken and taken[0][0] < born[thing]:
            heapq.heappush(free, heapq.heappop(taken)[1])
        result[thing] = heapq.heappop(free) if free else len(taken)
        heapq.heappush(taken, (int(last[thing]), int(result[thing])))
    return result
