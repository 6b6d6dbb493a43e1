import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scoring.assessment import average_precision, nearest_people


def ap(claims, people, threshold=0.1):
    """Return AP of estimates given as (nearest person, distance, score)."""
    person, distance, score = np.array(claims, float).reshape(-1, 3).T
    return average_precision(person.astype(int), distance, score, people=people, threshold=threshold)


def as_published(claims, people, threshold):
    """Reference: the evaluation released with VoxelPose, for scores without ties."""
    taken, correct = set(), []
    for person, distance, _ in sorted(claims, key=lambda claim: -claim[2]):
        correct.append(distance < threshold and person not in taken)
        if correct[-1]:
            taken.add(person)
    precision = [sum(correct[: k + 1]) / (k + 1) for k in range(len(correct))]
    return 100 * sum(max(precision[k:]) / people for k, hit in enumerate(correct) if hit)


def test_perfect_estimates_have_100_and_ghosts_alone_0():
    assert ap([(0, 0.0, 0.9), (1, 0.0, 0.8)], 2) == 100.0
    assert ap([(0, 9.0, 0.9), (0, np.inf, 0.8)], 2) == 0.0
    assert ap([], 2) == 0.0
    assert ap([(0, 9.0, 0.9)], 0) is None


def test_only_a_ghost_with_a_higher_score_lowers_ap():
    true = [(0, 0.0, 0.9), (1, 0.0, 0.8)]
    assert ap([*true, (1, 9.0, 0.1)], 2) == 100.0
    assert ap([*true, (1, 9.0, 0.85)], 2) == pytest.approx(100 * (1 + 2 / 3) / 2)
    assert ap([*true, (1, 9.0, 0.95)], 2) == pytest.approx(
        100 * 2 / 3
    )  # precision 1/2, then 2/3, which replaces the first


def test_a_person_is_found_once_only():
    assert ap([(0, 0.0, 0.9), (0, 0.0, 0.8)], 2) == 50.0


def test_a_distance_equal_to_the_threshold_is_wrong():
    assert ap([(0, 0.1, 0.9)], 1) == 0.0
    assert ap([(0, np.nextafter(0.1, 0), 0.9)], 1) == 100.0


def test_the_order_of_equal_scores_does_not_matter():
    assert ap([(0, 0.0, 0.5), (0, 9.0, 0.5)], 1) == ap([(0, 9.0, 0.5), (0, 0.0, 0.5)], 1) == 50.0


claims = st.lists(st.tuples(st.integers(0, 3), st.floats(0, 0.2)), max_size=8)


@given(claims, st.randoms())
def test_agrees_with_the_published_evaluation_in_any_order(places, random):
    scores = random.sample(range(100), len(places))
    given_claims = [(person, distance, score) for (person, distance), score in zip(places, scores, strict=True)]
    assert ap(given_claims, 4) == pytest.approx(as_published(given_claims, 4, 0.1))


@given(claims, st.lists(st.integers(0, 3), min_size=8, max_size=8), st.integers(0, 7), st.randoms())
def test_with_ties_neither_the_order_nor_a_worse_estimate_raises_ap(places, scores, worse, random):
    given_claims = [(person, distance, score) for (person, distance), score in zip(places, scores, strict=False)]
    before = ap(given_claims, 4)
    shuffled = random.sample(given_claims, len(given_claims))
    assert ap(shuffled, 4) == pytest.approx(before)
    if worse < len(given_claims):
        person, distance, score = given_claims[worse]
        given_claims[worse] = (person, distance + 1.0, score)
        assert ap(given_claims, 4) <= before + 1e-9


def test_estimates_are_assigned_to_the_nearest_person_of_their_frame():
    truth = np.zeros((2, 2, 2, 3))
    truth[0, 1] += 5.0
    truth[1] += 9.0
    truth[1, 1] = np.nan
    estimate = np.stack([truth[0, 1] + [0, 0, 0.3], truth[0, 0], truth[0, 0]])
    estimate[1, 1] = np.nan  # one shared joint is enough
    person, distance = nearest_people(truth, estimate, np.array([0, 0, 1]))
    assert person.tolist() == [1, 0, 2]
    np.testing.assert_allclose(distance, [0.3, 0.0, 9 * np.sqrt(3)])
    no_people = nearest_people(np.zeros((2, 0, 2, 3)), estimate, np.array([0, 0, 1]))
    assert np.isinf(no_people[1]).all()
