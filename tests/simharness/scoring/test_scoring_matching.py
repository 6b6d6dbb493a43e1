from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simharness.scoring.matching import GroupCounts, PairCounts, count_groups, count_pairs, count_violations


def test_a_perfect_matching():
    counts = count_pairs([0, 0, 1, 1, 2], [0, 1, 0, 1, 0], [7, 3, 7, 3, 7])
    assert counts == PairCounts(correct=4, wrong=0, lost=0)
    assert (counts.precision, counts.recall, counts.f1) == (1.0, 1.0, 1.0)


def test_one_view_of_three_matched_to_the_wrong_person():
    # Person 0 in views 0, 1, 2; person 1 in view 2 only, matched in place of person 0's detection there.
    counts = count_pairs([0, 1, 2, 2], [0, 0, -1, 0], [0, 0, 0, 1])
    assert counts == PairCounts(correct=1, wrong=2, lost=2)
    assert counts.precision == counts.recall == counts.f1 == pytest.approx(1 / 3)


def test_phantoms_and_unmatched_detections_are_in_no_correct_pair():
    assert count_pairs([0, 1], [-1, -1], [-1, -1]) == PairCounts(0, 0, 0)
    assert count_pairs([0, 1], [0, 0], [-1, -1]) == PairCounts(0, 1, 0)
    assert count_pairs([0, 1], [-1, -1], [4, 4]) == PairCounts(0, 0, 1)


def test_detections_of_one_view_are_no_pair():
    assert count_pairs([3, 3], [0, 0], [1, 1]) == PairCounts(0, 0, 0)


def test_shares_that_do_not_apply_are_none():
    assert count_pairs([], [], []).f1 is None
    assert PairCounts(0, 0, 5).precision is None
    assert PairCounts(0, 5, 0).recall is None
    assert PairCounts(0, 0, 5).f1 == 0.0


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(-1, 2), st.integers(-1, 2)), max_size=12), st.randoms())
def test_agrees_with_counting_by_hand_in_any_order(detections, random):
    correct, wrong, detected, joined = 0, 0, set(), set()
    for (view, label, person), (other_view, other_label, other_person) in combinations(detections, 2):
        matched, true = label == other_label != -1, person == other_person != -1
        if view != other_view:
            correct, wrong = correct + (matched and true), wrong + (matched and not true)
            place = (person, frozenset([view, other_view]))
            detected |= {place} if true else set()
            joined |= {place} if matched and true else set()
    random.shuffle(detections)
    counts = count_pairs(*np.array(detections, int).reshape(-1, 3).T)
    assert counts == PairCounts(correct, wrong, len(detected - joined))


def test_one_of_two_detections_of_a_person_in_a_view_is_enough():
    assert count_pairs([0, 0, 1], [5, -1, 5], [2, 2, 2]) == PairCounts(1, 0, 0)
    assert count_pairs([0, 0, 1], [-1, -1, 5], [2, 2, 2]) == PairCounts(0, 0, 1)


def test_lengths_must_agree():
    with pytest.raises(ValueError, match="labels"):
        count_pairs([0, 1], [0], [0, 0])


def test_a_perfect_grouping():
    assert count_groups([0, 0, 1, 1, 2], [0, 1, 0, 1, -1], [7, 3, 7, 3, -1]) == GroupCounts(0, 0, 1, 0)
    assert count_groups([], [], []) == GroupCounts(0, 0, 0, 0)


def test_a_group_of_two_people_is_merged_and_one_with_a_phantom_is_not():
    assert count_groups([0, 1, 2], [0, 0, 0], [4, 4, 5]) == GroupCounts(1, 0, 0, 0)
    assert count_groups([0, 1, 2], [0, 0, 0], [4, 4, -1]) == GroupCounts(0, 0, 1, 1)


def test_a_person_in_two_groups_is_split_and_a_half_matched_one_is_not():
    assert count_groups([0, 1, 2, 3], [0, 0, 1, 1], [4, 4, 4, 4]).split == 1
    assert count_groups([0, 1, 2, 3], [0, 0, -1, -1], [4, 4, 4, 4]).split == 0


def test_a_second_detection_in_a_view_makes_no_split():
    assert count_groups([0, 1, 2, 2], [0, 0, 0, 1], [4, 4, 4, 4]).split == 0
    assert count_groups([0, 1, 2, 2, 3], [0, 0, 0, 1, 1], [4, 4, 4, 4, 4]).split == 1  # view 3 is in the other group


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(-1, 2), st.integers(-1, 2)), max_size=12), st.randoms())
def test_groups_agree_with_counting_by_hand_in_any_order(detections, random):
    groups = {label: [each for each in detections if each[1] == label] for label in range(3)}
    merged = sum(len({person for _, _, person in group if person >= 0}) >= 2 for group in groups.values())
    split = 0
    for subject in range(3):
        views = [{view for view, _, person in group if person == subject} for group in groups.values()]
        split += set.union(*views) not in views
    phantoms = [label for _, label, person in detections if person < 0]
    doubled = sum(len(group) - len({view for view, _, _ in group}) for group in groups.values())
    random.shuffle(detections)
    view, labels, person = np.array(detections, int).reshape(-1, 3).T
    admitted = sum(label >= 0 for label in phantoms)
    assert count_groups(view, labels, person) == GroupCounts(merged, split, len(phantoms), admitted)
    assert count_violations(view, labels) == doubled
