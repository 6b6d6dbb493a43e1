from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scoring.pairing import pair


def points(*xs):
    """People of a single joint, on a line."""
    return np.array([[[x, 0.0, 0.0]] for x in xs], float).reshape(-1, 1, 3)


def test_pairs_people_and_counts_the_rest():
    pairing = pair(points(0, 2, 5), points(2.1, 9, 0.2))
    assert pairing.estimate.tolist() == [2, 0, -1]
    np.testing.assert_allclose(pairing.error, [0.2, 0.1, np.nan])


def test_an_estimate_serves_one_person_only():
    pairing = pair(points(0, 0.2), points(0.05))
    assert pairing.estimate.tolist() == [0, -1]


def test_the_number_of_pairs_is_the_largest_even_where_greedy_pairing_finds_fewer():
    # The best single pair is (1, 0) at 0.1; taking it leaves person 0 with an estimate 0.8 away.
    assert pair(points(0, 0.5), points(0.4, 0.8)).estimate.tolist() == [0, 1]


def test_the_limit_is_half_a_metre():
    assert pair(points(0), points(0.5)).estimate.tolist() == [0]
    assert pair(points(0), points(0.501)).estimate.tolist() == [-1]


def test_an_undefined_person_is_absent():
    truth = np.stack([np.full((2, 3), np.nan), np.zeros((2, 3)), np.zeros((2, 3))])
    truth[2] += 3
    pairing = pair(truth, truth[[1]])
    assert pairing.present.tolist() == [False, True, True]
    assert pairing.estimate.tolist() == [-1, 0, -1]


def test_a_person_with_one_defined_joint_is_present():
    truth = np.full((1, 2, 3), np.nan)
    truth[0, 1] = 0.0
    assert pair(truth, np.zeros((0, 2, 3))).present.tolist() == [True]
    assert pair(truth, np.zeros((1, 2, 3))).estimate.tolist() == [0]


def test_the_error_is_over_the_joints_that_both_have():
    truth, estimate = np.zeros((1, 3, 3)), np.zeros((1, 3, 3))
    estimate[0, :, 0] = 0.1, 0.3, np.nan
    truth[0, 0] = np.nan
    assert pair(truth, estimate).error.tolist() == [0.3]


def test_frames_without_people_or_estimates():
    assert pair(points(), points(1, 2)).estimate.tolist() == []
    assert pair(points(1, 2), points()).estimate.tolist() == [-1, -1]
    assert pair(points(0), np.full((1, 1, 3), np.nan)).estimate.tolist() == [-1]


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 4))
def test_agrees_with_exhaustive_search(seed, people, estimates):
    rng = np.random.default_rng(seed)
    truth, estimate = rng.uniform(0, 1, (people, 2, 3)), rng.uniform(0, 1, (estimates, 2, 3))
    distance = np.linalg.norm(truth[:, None] - estimate[None], axis=-1).mean(axis=-1)
    slots = [*range(estimates), *([-1] * people)]
    orders = [
        [distance[person, slot] for person, slot in enumerate(order) if slot >= 0]
        for order in set(permutations(slots, people))
    ]
    best = max((len(chosen), -sum(chosen)) for chosen in orders if all(d <= 0.5 for d in chosen))
    pairing = pair(truth, estimate)
    assert (pairing.estimate >= 0).sum() == best[0]
    assert np.nansum(pairing.error) == pytest.approx(-best[1])


def test_two_skeletons_are_refused():
    with pytest.raises(ValueError, match=r"estimate must be \(n, 14, 3\), got \(1, 17, 3\)"):
        pair(np.zeros((1, 14, 3)), np.zeros((1, 17, 3)))
