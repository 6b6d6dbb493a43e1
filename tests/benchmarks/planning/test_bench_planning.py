"""Benchmarks of planning: figures of subsets, and random scenarios."""

import numpy as np
import pytest
from scipy.stats import norm

from benchmarks.planning.blind_forecasts import BlindForecast, covered, fit_error
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


def test_errors_of_forecasts_are_found_again_and_their_intervals_hold_nine_in_ten():
    random = np.random.default_rng(4)
    size, noise = random.uniform(0, 40, (30, 60)), random.uniform(0, 1, (30, 60))
    error = random.normal(size=size.shape) * np.sqrt(1.5**2 + (0.3 * size) ** 2 + noise**2)
    figures = list(np.stack([100 - size, size, error, noise], axis=-1))
    fitted = fit_error(figures)
    assert fitted.least == pytest.approx(1.5, rel=0.15)
    assert fitted.share == pytest.approx(0.3, rel=0.1)
    held = np.mean([covered(fitted, each).mean() for each in figures])
    assert held == pytest.approx(2 * norm.cdf(fitted.quantile) - 1, abs=0.015)  # of errors that are really normal


def test_the_loss_of_a_camera_is_that_of_the_whole_set_less_the_others():
    real = {(0, 1): np.array([[80.0, 60.0], [50.0, 50.0]]), (0, 1, 2): np.array([[95.0, 85.0], [30.0, 40.0]])}
    said = {each: values + [[1.0], [10.0]] for each, values in real.items()}
    loss = BlindForecast("rig", real, False, said).figures("loss")
    assert loss[:, :3].tolist() == [[20.0, 20.0, 0.0]]  # of sets without one camera alone
    millimetres = BlindForecast("rig", real, False, said).figures("mm")
    assert millimetres[:, 2].tolist() == [-10.0, -10.0]
