"""Shapley values: published games, the axioms that define them, and all orders of joining."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.statistics.shapley import joining_orders, shapley_values, smallest_coalition, values_over_orders

GAMES = st.integers(1, 4).flatmap(
    lambda n: st.lists(st.floats(-10, 10, width=32), min_size=2**n, max_size=2**n).map(np.array)
)


def test_the_glove_game():
    """Players 0 and 1 have a left glove each, player 2 a right one; a pair is worth 1: 1/6, 1/6, 4/6."""
    worths = [float(mask & 4 > 0 and mask & 3 > 0) for mask in range(8)]
    assert shapley_values(worths) == pytest.approx([1 / 6, 1 / 6, 4 / 6])


def test_a_majority_with_weights():
    """Weights 4, 3, 2, 1 and a quota of 6 (a textbook game): 5/12, 3/12, 3/12, 1/12."""
    weights = np.array([4, 3, 2, 1])
    worths = [float(weights[[k for k in range(4) if mask >> k & 1]].sum() >= 6) for mask in range(16)]
    assert shapley_values(worths) == pytest.approx(np.array([5, 3, 3, 1]) / 12)


@given(GAMES)
def test_values_are_means_over_all_orders_and_add_up(worths):
    values = shapley_values(worths)
    players = len(values)
    orders = list(permutations(range(players)))
    assert values == pytest.approx(values_over_orders(lambda mask: worths[mask], orders), abs=1e-9)
    assert values.sum() == pytest.approx(worths[-1] - worths[0], abs=1e-9)


@given(GAMES, st.integers(0, 10))
def test_values_over_any_orders_add_up(worths, seed):
    players = len(worths).bit_length() - 1
    orders = joining_orders(players, 3, seed=seed)
    assert values_over_orders(lambda mask: worths[mask], orders).sum() == pytest.approx(
        worths[-1] - worths[0], abs=1e-9
    )


@given(GAMES)
def test_who_adds_nothing_has_no_value_and_like_players_have_like_values(worths):
    idle = np.concatenate([worths, worths])  # one more player, who adds nothing
    assert shapley_values(idle)[-1] == pytest.approx(0, abs=1e-9)
    players = len(worths).bit_length() - 1
    by_size = np.array(
        [worths[mask.bit_count()] if mask.bit_count() < len(worths) else 0 for mask in range(2**players)]
    )
    assert np.ptp(shapley_values(by_size)) == pytest.approx(0, abs=1e-9)


def test_values_of_many_games_at_once():
    worths = np.random.default_rng(0).random((3, 8))
    assert shapley_values(worths) == pytest.approx(np.array([shapley_values(each) for each in worths]))


def test_orders_are_drawn_with_their_reverses():
    orders = joining_orders(6, 4, seed=3)
    assert orders[1] == orders[0][::-1]
    assert orders[3] == orders[2][::-1]
    assert orders[0] != orders[2]
    assert orders == joining_orders(6, 4, seed=3) != joining_orders(6, 4, seed=4)


def test_the_smallest_coalition_that_is_good_enough():
    worths = np.array([0, 5, 4, 9, 6, 7, 8, 10.0])  # of none, a, b, ab, c, ac, bc, abc
    assert smallest_coalition(worths, 5.5) == 0b100  # c alone
    assert smallest_coalition(worths, 7.5) == 0b011  # of ab and bc the better one
    assert smallest_coalition(worths, 9.5) == 0b111
    assert smallest_coalition(worths, 99) == 0b111  # none is good enough: the best


def test_a_number_of_worths_that_is_no_power_of_two():
    with pytest.raises(ValueError, match=r"one for each coalition of n players, got \(3,\)"):
        shapley_values([0, 1, 2])
