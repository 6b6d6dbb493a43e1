import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from simharness.reality.detector_fit.tetrachoric import (
    correlation_grid,
    fit_life,
    joint_probability,
    tetrachoric_correlation,
)


@pytest.mark.parametrize(("p", "q"), [(0.5, 0.5), (0.1, 0.1), (0.02, 0.3), (0.9, 0.6)])
def test_joint_probability_of_a_bivariate_normal_distribution(p, q):
    h, k = norm.ppf([p, q])
    probabilities = joint_probability(p, q)
    assert probabilities[correlation_grid() == 0] == pytest.approx(p * q)
    assert correlation_grid()[0] == pytest.approx(-0.6)
    for index in (0, 10, 25, 40, 50, 70):
        rho = correlation_grid()[index]
        exact = multivariate_normal([0, 0], [[1, rho], [rho, 1]]).cdf([h, k])
        assert probabilities[index] == pytest.approx(exact, rel=2e-3, abs=5e-5)
    assert (np.diff(probabilities) >= -1e-12).all()
    assert probabilities[-1] == pytest.approx(min(p, q), rel=0.05)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8])
def test_the_correlation_is_recovered_from_events_of_different_probabilities(rho):
    rng = np.random.default_rng(0)
    both, expected = 0.0, np.zeros(len(correlation_grid()))
    for p, q in ((0.05, 0.05), (0.1, 0.3), (0.02, 0.2)):
        normal = rng.multivariate_normal([0, 0], [[1, rho], [rho, 1]], 60000)
        happens = normal < norm.ppf([p, q])
        both += happens.all(axis=1).sum()
        expected += 60000 * joint_probability(*happens.mean(axis=0))
    assert tetrachoric_correlation(np.array([both]), expected[None])[0] == pytest.approx(rho, abs=0.03)
    assert np.isnan(tetrachoric_correlation(np.zeros(1), np.zeros((1, len(correlation_grid()))))[0])


def test_lives_are_recovered_from_exponential_autocorrelations():
    lags, step = np.array([1, 2, 4, 8, 16]), 0.04
    lives = np.array([0.1, 0.5, 2.0])
    autocorrelation = np.exp(-lags * step / lives[:, None])
    np.testing.assert_allclose(fit_life(lags, step, autocorrelation, np.ones((3, 5))), lives, rtol=0.03)
    nothing = np.array([[0.0] * 5, [np.nan] * 5])
    found = fit_life(lags, step, nothing, np.array([[1.0] * 5, [1.0] * 5]))
    assert found[0] < step / 3
    assert np.isnan(found[1])
