import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from mvpose.matching.assignment import best_assignment, match_view_pairs


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


def test_pairs_of_views_are_matched_for_the_greatest_gain_over_alpha():
    """One match of 0.9 gains 0.4 over alpha; two matches of 0.6 have the greater affinity, but gain 0.2."""
    affinity = np.zeros((4, 4))
    affinity[:2, 2:] = [[0.9, 0.6], [0.6, 0.0]]
    affinity += affinity.T
    expected = np.zeros((4, 4))
    expected[0, 2] = expected[2, 0] = 0.9
    np.testing.assert_array_equal(match_view_pairs(affinity, np.array([0, 0, 1, 1])), expected)
    assert (match_view_pairs(affinity, np.array([0, 0, 1, 1]), alpha=0.2) > 0).sum() == 4
