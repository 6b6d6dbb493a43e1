"""Misses and jitters by the state of joints: shares and parameters, and their inference from counts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.reality.detector_fit.detector_measurement import MeasuredValue
from simharness.reality.detector_fit.inference import infer
from simharness.reality.detector_fit.parameters import SHARES
from simharness.reality.detector_fit.visibility_errors import (
    HIDDEN_ODDS,
    PARAMETERS,
    independent,
    prior_shares,
    with_parameters,
)
from simharness.scenario.sections.detector_section import LARGEST_MULTIPLE

KIND = "hips"
KEYS = [f"{key}.{KIND}" for key in SHARES]
OF = [f"{key}.{KIND}" for key in PARAMETERS]
PRIOR = {OF[0]: 0.04, OF[1]: 0.08, OF[2]: 1.5, OF[3]: 2.0}
JOINTS = (3000, 800, 300)
"""Visible, self-occluded and occluded ones of a recording."""

LEAK = 0.03
"""Share of the joints that count as visible, but are hidden."""


def shares_of(miss, jitter, *factors):
    """Return the four shares of a detector, from its definition."""
    wrong = [1 - (1 - miss * f) * (1 - jitter * f) for f in (1.0, *factors)]
    return dict(zip(KEYS, [*wrong, miss / wrong[0]], strict=True))


@given(st.floats(1e-5, 0.3), st.floats(1e-5, 0.3), st.tuples(st.floats(0.01, 1.0), st.floats(0.01, 1.0)))
def test_parameters_have_the_shares_that_they_are_made_of(miss, jitter, reach):
    most = min(1 / max(miss, jitter), LARGEST_MULTIPLE / 2)  # shares of hidden joints are 1 at most
    factors = [each * most for each in reach]
    found = with_parameters(shares_of(miss, jitter, *factors))
    assert [found[key] for key in OF] == pytest.approx([miss, jitter, *factors], rel=1e-5)


@given(st.floats(0.0, 1e-3), st.tuples(st.floats(0.01, 0.99), st.floats(0.01, 0.99)), st.floats(0.01, 0.99))
def test_hidden_joints_keep_their_shares_where_visible_ones_never_err(visible, hidden, gross):
    found = with_parameters(dict(zip(KEYS, [visible, *hidden, gross], strict=True)))
    assert max(found[key] for key in OF[2:]) <= LARGEST_MULTIPLE * (1 + 1e-9)
    assert list(shares_of(*(found[key] for key in OF)).values())[1:] == pytest.approx([*hidden, gross], rel=1e-5)


def test_values_without_shares_stay():
    values = {OF[0]: 0.1, "correlation.limb": 0.3, KEYS[0]: 0.2, KEYS[3]: np.nan}
    assert with_parameters(values) == pytest.approx(values, nan_ok=True)


def test_shares_take_the_place_of_the_parameters_of_their_kind():
    value = MeasuredValue(0.1, 0.05, 0.2, 100)
    other = ["keypoints.miss.knees", "share.gross.knees", "scores.good"]
    found = independent(dict.fromkeys([*KEYS, *OF, *other], value))
    assert set(found) == {*KEYS, other[0], other[2]}


def test_odds_of_hidden_joints_in_the_prior():
    found = prior_shares(PRIOR)
    visible, *hidden, gross = (found[key] for key in KEYS)
    assert visible == pytest.approx(1 - 0.96 * 0.92)
    assert gross == pytest.approx(0.04 / visible)
    for share in hidden:
        assert share / (1 - share) == pytest.approx(HIDDEN_ODDS * visible / (1 - visible))


def counted(parameters, rng):
    """Return the measured shares of a recording of JOINTS, and the numbers behind them.

    LEAK of the joints that count as visible are hidden by others, so that the measured shares are off. Each joint has
    its draws, as in the simulated detector, so that few of them change with the shares.
    """
    miss, jitter, *factors = (parameters[key] for key in OF)
    shares = shares_of(miss, jitter, *factors)
    visible, own, others, gross = (shares[key] for key in KEYS)
    leaked = int(LEAK * JOINTS[0])
    chances = np.repeat([visible, others, own, others], [JOINTS[0] - leaked, leaked, *JOINTS[1:]])
    error, missed = rng.random((2, len(chances)))
    wrong, missed = error < chances, missed < gross
    by_state = np.split(wrong, np.cumsum(JOINTS)[:-1])
    measured = [*map(np.mean, by_state), (wrong & missed).sum() / max(wrong.sum(), 1)]
    return dict(zip(KEYS, map(float, measured), strict=True)), [*JOINTS, int(wrong.sum())]


def measured_of(parameters, seed):
    found, counts = counted(parameters, np.random.default_rng([19, seed]))
    result = {}
    for (key, share), n in zip(found.items(), counts, strict=True):
        reach = 1.96 * np.sqrt(share * (1 - share) / n)
        high = share + reach if share else 3 / n
        result[key] = MeasuredValue(share, max(share - reach, 0.0), high, n)
    unused = MeasuredValue(1.0, 0.5, 2.0, sum(JOINTS))
    return {**result, **dict.fromkeys(OF, unused)}


@pytest.mark.slow
@pytest.mark.parametrize(
    "true",
    [(0.0002, 0.002, 60.0, 50.0), (0.01, 0.02, 4.0, 10.0), (0.05, 0.08, 1.0, 2.0)],
    ids=["visible joints hardly err", "many errors of hidden joints", "poor"],
)
def test_shares_of_hidden_joints_are_consistent(true):
    """Over recordings, inferred shares of hidden joints are the true ones, also where the prior is far off."""
    parameters = dict(zip(OF, true, strict=True))
    wanted = np.array([shares_of(*true)[key] for key in KEYS])
    found, inside = [], []
    for seed in range(30):
        inferred = infer(
            measured_of(parameters, seed),
            lambda values, draw, s=seed: counted(values, np.random.default_rng([23, s, draw]))[0],
            PRIOR,
        )
        found.append([shares_of(*(inferred[key].value for key in OF))[key] for key in KEYS])
        inside.append([inferred[key].low <= each <= inferred[key].high for key, each in parameters.items()])
    error = np.log(found / wanted)
    assert np.abs(error[:, 1:3].mean(axis=0)).max() < 0.06
    # That of a count of those joints, and some of the simulations.
    deviation = np.sqrt((1 - wanted[1:3]) / (np.array(JOINTS[1:]) * wanted[1:3]))
    assert (error[:, 1:3].std(axis=0) < 1.4 * deviation).all()
    assert np.mean(inside) > 0.9
