"""Distance of a recording from its twins: false alarms and power, of figures drawn from known distributions."""

import numpy as np
import pytest

from simharness.reality.validation.evidence import compared
from simharness.reality.validation.twin_distance import NOTICED, measure_distance


def figures(real, twins, *, error=0.0):
    """Figures of a recording (K,) and of n twins (n, K); groups of five."""
    drawn = np.random.default_rng(0).normal(scale=error, size=100) if error else np.zeros(1)
    return {
        f"group{k // 5}.{k}": compared(value, value + drawn, of.tolist())
        for k, (value, of) in enumerate(zip(real, twins.T, strict=True))
    }


def draws(rng, count, *, size=60, rank=6):
    """Correlated figures, (count, size): common causes and noise."""
    loads = np.random.default_rng(99).normal(size=(rank, size))
    return rng.normal(size=(count, rank)) @ loads + rng.normal(size=(count, size))


@pytest.mark.slow
@pytest.mark.parametrize("twins", [4, 10])
def test_a_further_twin_is_noticed_as_often_as_promised(twins):
    rng = np.random.default_rng(twins)
    chances = []
    for _ in range(300):
        every = draws(rng, twins + 1)
        chances.append(measure_distance(figures(every[0], every[1:])).p_value)
    assert np.mean(np.array(chances) < NOTICED) <= 0.08
    assert np.mean(np.array(chances) < 0.5) == pytest.approx(0.5, abs=0.1)


@pytest.mark.slow
def test_wrong_twins_are_noticed():
    rng = np.random.default_rng(0)
    noticed = []
    for _ in range(40):
        every = draws(rng, 11)
        every[0, :15] += 12.0
        found = measure_distance(figures(every[0], every[1:]))
        noticed.append(found.noticed)
        assert next(iter(found.groups)) in {"group0", "group1", "group2"}
    assert np.mean(noticed) > 0.9


def test_twins_in_which_something_never_happens_are_noticed():
    """Figures that are constant over twins are compared by the error of the recording's."""
    twins = np.zeros((10, 20))
    twins[:, 10:] = np.random.default_rng(0).normal(size=(10, 10))
    same = 0.3 * np.ones(20)
    assert not measure_distance(figures(same, twins, error=1.0)).noticed
    assert measure_distance(figures(same + np.append(10 * np.ones(10), np.zeros(10)), twins, error=1.0)).noticed


def test_what_is_unknown_is_left_out():
    every = draws(np.random.default_rng(0), 6, size=10)
    every[0, 0] = every[3, 1] = np.nan
    assert measure_distance(figures(every[0], every[1:])).figures == 8
    few = measure_distance(figures(every[0], every[1:4]))
    assert np.isnan(few.p_value)
    assert not few.noticed
