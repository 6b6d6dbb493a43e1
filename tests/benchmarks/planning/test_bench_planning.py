"""Benchmarks of planning: figures of subsets, and random scenarios."""

import numpy as np
import pytest

from benchmarks.planning.shelf_subsets import SubsetFigures
from benchmarks.planning.simulated_rigs import random_scenario

REAL = {(0, 1): 70.0, (0, 2): 80.0, (1, 2): 90.0, (0, 1, 2): 95.0}


def test_figures_of_a_prediction_that_exchanges_two_pairs():
    figures = SubsetFigures(REAL, {(0, 1): 80.0, (0, 2): 70.0, (1, 2): 88.0, (0, 1, 2): 95.0})
    assert figures.rank(2) == pytest.approx(0.5)  # 1 - 6 sum d^2 / (n (n^2 - 1)) = 1 - 12 / 24
    assert figures.rank() == pytest.approx(1 - 12 / 60)
    assert figures.mean_difference == pytest.approx((10 + 10 + 2 + 0) / 4)
    assert figures.chosen(2) == ((1, 2), (1, 2))
    assert "0.0 lost" in str(figures)


def test_the_best_subset_of_a_size_is_chosen_by_the_prediction():
    figures = SubsetFigures(REAL, {(0, 1): 99.0, (0, 2): 70.0, (1, 2): 88.0, (0, 1, 2): 95.0})
    assert figures.chosen(2) == ((0, 1), (1, 2))
    assert "20.0 lost" in str(figures)


def test_random_scenarios_follow_from_the_seed_and_have_their_cameras_in_the_room():
    scenarios = [random_scenario(seed) for seed in range(40)]
    assert random_scenario(7) == scenarios[7]
    assert {len(each.cameras.positions) for each in scenarios} == set(range(3, 9))
    assert {each.people.count for each in scenarios} >= {1, 2, 3, 4}
    for each in scenarios:
        assert (np.abs(np.array(each.cameras.positions)[:, :2]) < np.array(each.room.size[:2]) / 2).all()
