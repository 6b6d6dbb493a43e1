"""Few combinations of values in which every pair of values of two axes occurs.

Most faults show in one value, or in two of different axes together. The search is that of Cohen et al., "The AETG
system: an approach to testing based on combinatorial design", IEEE TSE 23(7), 1997: combinations are added one after
another, each the one of several candidates with the most pairs that none before it has.
"""

import itertools
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from mvpose.arrays import Bools, Integers
from simharness.types.random_streams import stream

_CANDIDATES = 30  # the authors found little gain from 50 on


@lru_cache(maxsize=64)
def pairwise(sizes: Sequence[int]) -> tuple[tuple[int, ...], ...]:
    """Return combinations of indices, one of each axis, the same in every run.

    Args:
        sizes: numbers of values of the axes.
    """
    if len(sizes) < 2:
        return tuple(itertools.product(*map(range, sizes)))
    starts = np.cumsum([0, *sizes])
    axis = np.repeat(np.arange(len(sizes)), sizes)
    missing: Bools = axis[:, None] != axis  # whether two values, by their places among all values, have not met
    chosen: list[tuple[int, ...]] = []
    while missing.any():
        candidates = [_candidate(missing, starts, len(chosen), k) for k in range(_CANDIDATES)]
        best = max(candidates, key=lambda each: missing[np.ix_(each, each)].sum())
        missing[np.ix_(best, best)] = False
        chosen.append(tuple((best - starts[:-1]).tolist()))
    return tuple(chosen)


def _candidate(missing: Bools, starts: Integers, row: int, number: int) -> Integers:
    """Return a combination, as places among all values: axes in random order, of each the value with most new pairs."""
    rng = stream(0, "pairwise", row, number)
    places = np.full(len(starts) - 1, -1)
    needed = missing.sum(axis=1)
    first = rng.choice(np.flatnonzero(needed == needed.max()))
    places[np.searchsorted(starts, first, side="right") - 1] = first
    for k in rng.permutation(np.flatnonzero(places < 0)):
        gain = missing[starts[k] : starts[k + 1], places[places >= 0]].sum(axis=1)
        places[k] = starts[k] + rng.choice(np.flatnonzero(gain == gain.max()))
    return places
