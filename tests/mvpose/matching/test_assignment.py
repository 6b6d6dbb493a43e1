import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from mvpose.matching.assignment import best_assignment


@given(st.integers(0, 12), st.integers(0, 12), st.sampled_from([0, 1, 8]), st.integers(0, 100_000))
def test_the_total_value_equals_that_of_scipy(rows, columns, digits, seed):
    """Rounded values cause ties; pairs of negative value stay unmatched."""
    value = np.random.default_rng(seed).normal(0.2, 1.0, (rows, columns)).round(digits)
    chosen = best_assignment(value)
    assigned = np.flatnonzero(chosen >= 0)
    assert len(set(chosen[assigned].tolist())) == len(assigned)
    assert (value[assigned, chosen[assigned]] > 0).all()
    i, j = linear_sum_assignment(np.maximum(value, 0.0), maximize=True)
    np.testing.assert_allclose(value[assigned, chosen[assigned]].sum(), np.maximum(value, 0.0)[i, j].sum(), atol=1e-9)


def test_a_long_chain_of_displacements():
    """Row k prefers column k - 1, then k; the last row can only have column 0."""
    n = 40
    value = np.zeros((n, n))
    value[np.arange(1, n), np.arange(n - 1)] = 2.0
    value[np.arange(n - 1), np.arange(n - 1)] = 1.9
    value[n - 1, n - 1] = 0.0
    assert best_assignment(value).tolist() == [-1, *range(n - 1)]
