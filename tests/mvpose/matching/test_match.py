import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose.matching import Matcher, match, objective
from mvpose.matching.rounding import round_to_people

METHODS = ("admm", "clustering", "hungarian")


@st.composite
def anything(draw):
    """Affinities of any values, views in any order."""
    rng = np.random.default_rng(draw(st.integers(0, 100_000)))
    view = rng.integers(0, draw(st.integers(1, 6)), draw(st.integers(0, 14)))
    affinity = rng.choice([0.0, 0.3, 0.5, 0.7, 1.0], (len(view), len(view))) * rng.random((len(view), len(view))).round(
        1
    )
    affinity = np.triu(affinity, 1)
    affinity = affinity + affinity.T
    return affinity, view


def consistent(labels, view):
    """At most one detection of a view in a person, at least two in all, numbered 0 to n - 1."""
    people = [view[labels == person] for person in range(labels.max(initial=-1) + 1)]
    return all(len(views) >= 2 and len(set(views.tolist())) == len(views) for views in people)


@pytest.mark.parametrize("method", METHODS)
@given(case=anything())
def test_every_result_is_cycle_consistent(method, case):
    affinity, view = case
    result = match(affinity, view, method=method)
    assert consistent(result.labels, view)
    assert result.objective == pytest.approx(objective(result.labels, affinity))


@given(anything(), st.floats(0, 1))
def test_rounding_is_consistent_whatever_p_is(case, threshold):
    affinity, view = case
    assert consistent(round_to_people(affinity, view, threshold=threshold), view)


def test_rounding_breaks_the_weakest_link_of_a_chain():
    """0-1 and 1-2 say one person, but 0 and 2 are of one view."""
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
def test_phantoms_are_pruned_and_one_person_is_found(method):
    view = np.array([0, 1, 2, 0, 1])
    affinity = np.zeros((5, 5))
    affinity[:3, :3] = 0.9 * (1 - np.eye(3))
    affinity[3, 1] = affinity[1, 3] = 0.4  # a phantom that agrees a little with one view
    assert match(affinity, view, method=method).labels.tolist() == [0, 0, 0, -1, -1]


@pytest.mark.parametrize("method", METHODS)
def test_two_views_are_matched_as_the_hungarian_algorithm_would(method):
    """Greedy takes the 0.9; the best sum takes 0.8 + 0.8 (less alpha each)."""
    view = np.array([0, 0, 1, 1])
    affinity = np.zeros((4, 4))
    affinity[:2, 2:] = [[0.9, 0.8], [0.8, 0.1]]
    affinity[2:, :2] = affinity[:2, 2:].T
    assert match(affinity, view, method=method).labels.tolist() == [0, 1, 1, 0]


def test_a_match_must_earn_more_than_alpha():
    affinity = np.array([[0, 0.6], [0.6, 0]])
    assert match(affinity, [0, 1], alpha=0.5).labels.tolist() == [0, 0]
    assert Matcher(alpha=0.7)(affinity, np.array([0, 1])).labels.tolist() == [-1, -1]


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="symmetric"):
        match(np.triu(np.ones((2, 2)), 1), [0, 1])
    with pytest.raises(ValueError, match=r"affinity must be \(2, 2\)"):
        match(np.ones((3, 3)), [0, 1])
    with pytest.raises(ValueError, match="method"):
        match(np.zeros((2, 2)), [0, 1], method="magic")
