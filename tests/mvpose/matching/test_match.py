import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from instances import filmed, sort_by_view
from scipy.optimize import linear_sum_assignment

from mvpose.matching import Matcher, match
from mvpose.matching.assignment import best_assignment, match_view_pairs
from mvpose.matching.rounding import round_to_people

METHODS = ("admm", "clustering", "hungarian")


@st.composite
def anything(draw, most=14):
    """Affinities with any values, including ties, zeros and ones; views of any size in any order."""
    rng = np.random.default_rng(draw(st.integers(0, 100_000)))
    view = rng.integers(0, draw(st.integers(1, most)), draw(st.integers(0, most))) * draw(st.sampled_from([1, 1000]))
    levels = draw(st.sampled_from([[0.0], [1.0], [0.5], [0.0, 1.0], [0.0, 0.3, 0.5, 0.7, 1.0], rng.random(200)]))
    affinity = np.triu(rng.choice(levels, (len(view), len(view))), 1)
    return affinity + affinity.T, view


def consistent(labels, view):
    """Return whether people have at most one detection per view, at least two in total, and numbers 0 to n - 1."""
    people = [view[labels == person] for person in range(labels.max(initial=-1) + 1)]
    return all(len(views) >= 2 and len(set(views.tolist())) == len(views) for views in people)


@pytest.mark.parametrize("method", METHODS)
@given(case=anything(), alpha=st.sampled_from([0.0, 0.3, 0.5, 1.0]))
def test_every_result_is_cycle_consistent(method, case, alpha):
    affinity, view = case
    result = match(affinity, view, method=method, alpha=alpha)
    assert consistent(result.labels, view)
    together = (result.labels[:, None] == result.labels) & (result.labels[:, None] >= 0)
    assert result.objective == pytest.approx(np.triu(together * (alpha - affinity), 1).sum())
    assert result.objective <= 1e-9 or method != "clustering"  # leaving all apart is worth 0


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=10)
@given(case=anything(most=150))
def test_large_results_are_cycle_consistent(method, case):
    affinity, view = case
    result = match(affinity, view, method=method)
    assert consistent(result.labels, view)
    assert method != "admm" or result.converged == (max(result.residuals) < 5e-4)


@given(anything())
def test_admm_reports_a_relaxed_solution_in_the_order_of_the_detections(case):
    affinity, view = case
    P = match(affinity, view).P
    same = view[:, None] == view
    assert P.shape == affinity.shape
    np.testing.assert_array_equal(P, P.T)
    np.testing.assert_array_equal(P[same], np.eye(len(view))[same])


@given(anything(), st.floats(0, 1))
def test_rounding_is_consistent_whatever_p_is(case, threshold):
    affinity, view = case
    assert consistent(round_to_people(affinity, view, threshold=threshold), view)


@pytest.mark.parametrize(("p", "matched"), [(0.45, False), (0.55, True)])
def test_a_match_needs_p_above_one_half(p, matched):
    """The paper's threshold is the default."""
    labels = round_to_people(np.array([[1.0, p], [p, 1.0]]), np.array([0, 1]))
    assert labels.tolist() == ([0, 0] if matched else [-1, -1])


def test_rounding_breaks_the_weakest_link_of_a_chain():
    """0-1 and 1-2 match, but 0 and 2 are of one view."""
    view = np.array([0, 1, 0])
    P = np.array([[1, 0.9, 0.1], [0.9, 1, 0.6], [0.1, 0.6, 1]])
    assert round_to_people(P, view).tolist() == [0, 0, -1]


@pytest.mark.parametrize("method", METHODS)
def test_matching_does_not_depend_on_the_order_of_detections(method):
    rng = np.random.default_rng(5)
    view, person = np.divmod(np.arange(20), 4)
    affinity = np.where(person[:, None] == person, 0.8, 0.2) + 0.02 * rng.standard_normal((20, 20))
    affinity = np.triu(affinity, 1) + np.triu(affinity, 1).T
    affinity[view[:, None] == view] = 0
    order = rng.permutation(20)
    there = match(affinity, view, method=method).labels
    shuffled = match(affinity[np.ix_(order, order)], view[order], method=method).labels
    np.testing.assert_array_equal(there[order][:, None] == there[order], shuffled[:, None] == shuffled)
    np.testing.assert_array_equal(there[:, None] == there, person[:, None] == person)


@pytest.mark.parametrize("method", METHODS)
def test_hard_matchings_do_not_depend_on_the_order_either(method):
    rng = np.random.default_rng(0)
    for seed in range(20):
        affinity, view, _ = sort_by_view(*filmed(seed, views=6, people=9))
        within = [rng.permutation(np.flatnonzero(view == v)) for v in np.unique(view)]
        order = np.concatenate(within)[rng.permutation(len(view))]
        there = match(affinity, view, method=method).labels[order]
        shuffled = match(affinity[np.ix_(order, order)], view[order], method=method).labels
        np.testing.assert_array_equal(
            (there[:, None] == there) & (there >= 0), (shuffled[:, None] == shuffled) & (shuffled >= 0)
        )


@pytest.mark.parametrize("method", METHODS)
def test_phantoms_are_pruned_and_one_person_is_found(method):
    view = np.array([0, 1, 2, 0, 1])
    affinity = np.zeros((5, 5))
    affinity[:3, :3] = 0.9 * (1 - np.eye(3))
    affinity[3, 1] = affinity[1, 3] = 0.4  # a phantom that agrees a little with one view
    assert match(affinity, view, method=method).labels.tolist() == [0, 0, 0, -1, -1]


@pytest.mark.parametrize("method", METHODS)
def test_two_views_are_matched_as_the_hungarian_algorithm_would(method):
    """A greedy method takes 0.9; the best sum is 0.8 + 0.8 (minus alpha each)."""
    view = np.array([0, 0, 1, 1])
    affinity = np.zeros((4, 4))
    affinity[:2, 2:] = [[0.9, 0.8], [0.8, 0.1]]
    affinity[2:, :2] = affinity[:2, 2:].T
    assert match(affinity, view, method=method).labels.tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize("method", ["admm", "clustering", "hungarian"])
@pytest.mark.parametrize(("affinity", "matched"), [(0.45, False), (0.55, True)])
def test_by_default_two_detections_match_if_one_person_is_likelier_than_two(method, affinity, matched):
    matrix, view = np.array([[0.0, affinity], [affinity, 0.0]]), np.array([0, 1])
    expected = [0, 0] if matched else [-1, -1]
    assert Matcher(method=method)(matrix, view).labels.tolist() == expected
    assert match(matrix, view, method=method).labels.tolist() == expected


def test_a_match_needs_an_affinity_above_alpha():
    affinity = np.array([[0, 0.6], [0.6, 0]])
    assert match(affinity, [0, 1], alpha=0.5).labels.tolist() == [0, 0]
    assert Matcher(alpha=0.7)(affinity, np.array([0, 1])).labels.tolist() == [-1, -1]


@pytest.mark.parametrize("method", METHODS)
def test_any_kind_of_array_gives_the_same_people(method):
    view, person = np.divmod(np.arange(12), 3)
    affinity = np.where((person[:, None] == person) & (view[:, None] != view), 0.75, 0.25)
    frozen = affinity.copy()
    frozen.flags.writeable = False
    for same in (affinity.tolist(), affinity.astype(np.float32), np.asfortranarray(affinity), frozen):
        assert match(same, view.tolist(), method=method).labels.tolist() == person.tolist()


def test_rounding_errors_do_not_count_as_asymmetry():
    affinity = np.array([[0, 0.7, 0.7], [0.7, 0, 0.7], [0.7 + 1e-8, 0.7, 0]])
    assert match(affinity, [0, 1, 2], method="clustering").labels.tolist() == [0, 0, 0]


@pytest.mark.parametrize("size", [2, 70])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, -0.1, 1.1, 0.6])
def test_invalid_affinities_are_refused(size, wrong):
    """At any position; 0.6 makes the matrix asymmetric."""
    for at in [(0, 1), (1, 0), (size - 1, 0), (0, size - 1)]:
        affinity = np.full((size, size), 0.5)
        affinity[at] = wrong
        with pytest.raises(ValueError, match=r"affinity must be symmetric with values in 0\.\.1"):
            match(affinity, np.arange(size), method="clustering")


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="symmetric"):
        match(np.triu(np.ones((2, 2)), 1), [0, 1])
    with pytest.raises(ValueError, match=r"view must be \(m,\), got \(1, 2\)"):
        match(np.zeros((2, 2)), np.zeros((1, 2), int))
    with pytest.raises(ValueError, match=r"alpha must lie in 0\.\.1"):
        Matcher(alpha=np.nan)
    with pytest.raises(ValueError, match=r"affinity must be \(2, 2\)"):
        match(np.ones((3, 3)), [0, 1])
    with pytest.raises(ValueError, match="method"):
        match(np.zeros((2, 2)), [0, 1], method="magic")


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


@pytest.mark.parametrize("seed", range(4))
def test_each_pair_of_views_is_matched_by_itself_in_any_order_of_detections(seed):
    """Four views: each block is the best partial permutation of its two views alone, by SciPy."""
    rng = np.random.default_rng(seed)
    view = rng.permutation(np.repeat(np.arange(4), [2, 3, 1, 4]))
    affinity = rng.random((10, 10))
    affinity = np.where(view[:, None] == view, 0.0, (affinity + affinity.T) / 2)
    found = match_view_pairs(affinity, view, alpha=0.4)
    expected = np.zeros_like(affinity)
    for one, other in itertools.combinations(range(4), 2):
        rows, columns = np.flatnonzero(view == one), np.flatnonzero(view == other)
        gain = np.maximum(affinity[np.ix_(rows, columns)] - 0.4, 0.0)
        for i, j in zip(*linear_sum_assignment(gain, maximize=True), strict=True):
            if gain[i, j] > 0.0:
                a, b = rows[i], columns[j]
                expected[a, b] = expected[b, a] = affinity[a, b]
    np.testing.assert_array_equal(found, expected)
    assert (found > 0).sum() > 8
