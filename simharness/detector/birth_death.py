"""M/M/∞ birth-death process for false positives: when each one appears and how long it lasts."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import pdtr

from mvpose.arrays import Floats, Integers
from simharness.detector.draws import Key, KeyedDraws
from simharness.types.random_streams import stream

_LAYER = 0.25  # mean number alive at once in a layer: as many layers are drawn as the rate needs
_COUNTS = np.arange(20)  # births of a layer in a frame; more have a probability of 1e-29


@dataclass(frozen=True)
class BirthDeathProcess:
    """Births and deaths of n individuals, each present from one frame to another.

    Individuals come in layers. In every frame the number alive in a layer is Poisson distributed, the first frame
    included, and each of them lives on for an independent exponential time: the queue M/M/∞ at the times of the
    frames; with a life of zero, independent frames. Lower rates are reached by thinning: an individual that is present
    at a rate is present at every higher rate.

    Attributes:
        draws: draws of the sequence.
        key: name of the process; all its streams begin with it.
        life: mean life, seconds; 0: each individual is present in one frame.
        max_rate: highest rate that is drawn, mean number alive at once.
    """

    draws: KeyedDraws
    key: tuple[Key, ...]
    life: float
    max_rate: float

    @property
    def born(self) -> Integers:
        """First frame of each individual, (n,)."""
        return np.concatenate([np.zeros(0, int), *self._births])

    @cached_property
    def last(self) -> Integers:
        """Last frame of each individual, (n,)."""
        frames = self.life / self.draws.step
        lasting = np.minimum(frames * self._drawn("life", (), np.random.Generator.standard_exponential), 1e9)
        return np.minimum(self.born + lasting.astype(int), len(self.draws.time) - 1)

    @cached_property
    def rate_threshold(self) -> Floats:
        """Rate above which each individual is present, (n,)."""
        layer = np.repeat(np.arange(len(self._births)), [len(births) for births in self._births])
        return _LAYER * (layer + self.uniform("mark"))

    @cached_property
    def offset(self) -> Integers:
        """Offset of each individual in blocks of noise (:func:`frame_noise`), (n,), at any rate the same."""
        return np.concatenate([np.zeros(0, int), *(np.arange(len(b)) + 5 * k for k, b in enumerate(self._births))])

    @cached_property
    def identifier(self) -> Integers:
        """Unique number of each individual, (n,), across keys and at any rate the same.

        It has 53 random bits: among a million individuals two share one with a probability of 1 in 18000.
        """
        return (2.0**53 * self.uniform("name")).astype(np.int64)

    def normal(self, purpose: str, *shape: int) -> Floats:
        """Draw standard normal numbers for each individual, ``(n, *shape)``."""
        return self._drawn(purpose, shape, np.random.Generator.standard_normal)

    def uniform(self, purpose: str, *shape: int) -> Floats:
        """Draw uniform numbers for each individual, ``(n, *shape)``."""
        return self._drawn(purpose, shape, np.random.Generator.random)

    @cached_property
    def _births(self) -> list[Integers]:
        """Frames of birth in each layer, in rising order."""
        frames = np.arange(len(self.draws.time))
        mean = _LAYER * (-np.expm1(-self.draws.step / self.life) if self.life else 1.0)
        later, first = pdtr(_COUNTS, mean), pdtr(_COUNTS, _LAYER)
        births = []
        for layer in range(int(np.ceil(self.max_rate / _LAYER))):
            uniform = self._stream("births", layer).random(len(frames))
            count = np.searchsorted(later, uniform)
            count[:1] = np.searchsorted(first, uniform[:1])
            births.append(np.repeat(frames, count))
        return births

    def _drawn(
        self, purpose: str, shape: tuple[int, ...], draw: Callable[[np.random.Generator, tuple[int, ...]], Floats]
    ) -> Floats:
        parts = [draw(self._stream(purpose, k), (len(births), *shape)) for k, births in enumerate(self._births)]
        return np.concatenate([np.zeros((0, *shape)), *parts])

    def _stream(self, purpose: str, layer: int) -> np.random.Generator:
        return stream(self.draws.seed, "detector", *self.key, purpose, layer)


def frames_alive(born: Integers, last: Integers) -> tuple[Integers, Integers]:
    """Return all r pairs of an individual and a frame in which it is alive: its index (r,) and the frame (r,)."""
    count = last - born + 1
    individual = np.repeat(np.arange(len(born)), count)
    return individual, born[individual] + np.arange(len(individual)) - np.repeat(np.cumsum(count) - count, count)


def frame_noise(draws: KeyedDraws, *key: Key, offset: Integers, frame: Integers, size: int) -> Floats:
    """Return standard normal noise for the joints of individuals, independent in every frame, (r, 17, size).

    One block of the sequence serves all individuals: each begins at another joint of it.

    Args:
        draws: draws of the sequence.
        key: name of the noise.
        offset: joint of the block at which each individual begins, (r,).
        frame: frame of each row, (r,).
        size: numbers for each joint.
    """
    block = draws.normal(*key, "anew", shape=(17, size))
    return block[frame[:, None], (np.arange(17) + offset[:, None]) % 17]


def assign_slots(born: Integers, last: Integers) -> Integers:
    """Return a slot for each individual, (n,), that it keeps while it lives: the first that is free at its birth."""
    taken: list[tuple[int, int]] = []
    free: list[int] = []
    result = np.zeros(len(born), int)
    for individual in np.argsort(born, kind="stable").tolist():
        while taken and taken[0][0] < born[individual]:
            heapq.heappush(free, heapq.heappop(taken)[1])
        result[individual] = heapq.heappop(free) if free else len(taken)
        heapq.heappush(taken, (int(last[individual]), int(result[individual])))
    return result
