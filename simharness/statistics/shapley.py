"""Shapley values of a game, exactly or from orders of joining, and the smallest coalition that is good enough.

A coalition is a bit mask: bit i is set where player i is in it. The worths of all coalitions are an array of 2^n
numbers, by bit mask.
"""

from collections.abc import Callable, Iterable, Sequence
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats
from simharness.types.random_streams import stream


def shapley_values(worths: ArrayLike) -> Floats:
    """Return the Shapley value of every player, (..., n).

    It is the mean, over all orders in which players may join, of what a player adds to those before it (Shapley, "A
    value for n-person games", 1953). The values add up to the worth of all players minus that of none; players who add
    the same to every coalition have the same value, and a player who adds nothing has none.

    Args:
        worths: worth of each coalition, (..., 2^n).

    Raises:
        ValueError: a number of worths that is no power of two.
    """
    worths = np.asarray(worths, float)
    count = worths.shape[-1] if worths.ndim else 0
    n = count.bit_length() - 1
    if count < 1 or count != 1 << n:
        raise ValueError(f"worths must be (..., 2^n), one for each coalition of n players, got {worths.shape}")
    coalitions = np.arange(count)
    weight = np.array([factorial(size) * factorial(n - size - 1) / factorial(n) for size in range(n)])
    values = np.empty((*worths.shape[:-1], n))
    for player in range(n):
        without = coalitions[coalitions >> player & 1 == 0]
        added = worths[..., without | 1 << player] - worths[..., without]
        values[..., player] = added @ weight[np.bitwise_count(without)]
    return values


def joining_orders(players: int, count: int, *, seed: int) -> list[tuple[int, ...]]:
    """Draw random orders of players, each followed by its reverse, which joins early whom the first joins late.

    Args:
        players: n, number of players.
        count: number of orders; where it is odd, the last has no reverse.
        seed: seed of the draws.
    """
    random = stream(seed, "shapley", "orders")
    drawn = [tuple(random.permutation(players).tolist()) for _ in range(-(-count // 2))]
    return [order for each in drawn for order in (each, each[::-1])][:count]


def values_over_orders(worth: Callable[[int], float], orders: Iterable[Sequence[int]]) -> Floats:
    """Return the mean of what each player adds to those before it, over orders of joining, (n,).

    Over all orders it is the Shapley value, over random ones an unbiased estimate of it; over any, the values add up to
    the worth of all players minus that of none.

    Args:
        worth: worth of a coalition, a bit mask.
        orders: orders of all n players, one or more.
    """
    rows = []
    for order in orders:
        masks = np.bitwise_or.accumulate([0, *(1 << player for player in order)])
        added = np.diff([worth(int(mask)) for mask in masks])
        row = np.empty(len(order))
        row[list(order)] = added
        rows.append(row)
    return np.mean(rows, axis=0)


def smallest_coalition(worths: ArrayLike, target: float) -> int:
    """Return the smallest coalition with at least a target worth, a bit mask; of several, the one of the highest worth.

    Args:
        worths: worth of each coalition, (2^n,).
        target: least worth. Where no coalition has it, the coalition of the highest worth is returned.
    """
    worths = np.asarray(worths, float)
    n = len(worths).bit_length() - 1
    size = ((np.arange(len(worths))[:, None] >> np.arange(n)) & 1).sum(axis=1)
    enough = worths >= target - 1e-9
    if not enough.any():
        enough = worths >= worths.max()
    order = np.lexsort((-worths, size))
    return int(order[enough[order]][0])
