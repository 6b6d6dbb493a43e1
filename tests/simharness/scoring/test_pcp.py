import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mvpose import SHELF14
from simharness.scoring.frame_scores import score_frames
from simharness.scoring.pairing import mean_distances
from simharness.scoring.pcp import GROUPS, PARTS, Part, nearest, percent

# A person whose coordinates are multiples of 1/8 m, so that every length below is exact in floating point.
# fmt: off
PERSON = np.array([
    [0, -.125, 0], [0, -.125, .5], [0, -.125, 1],      # right ankle, knee, hip: legs of 0.5
    [0, .125, 1], [0, .125, .5], [0, .125, 0],         # left hip, knee, ankle
    [0, -.25, .875], [0, -.25, 1.125], [0, -.25, 1.5],  # right wrist, elbow, shoulder: 0.25 and 0.375
    [0, .25, 1.5], [0, .25, 1.125], [0, .25, .875],    # left
    [0, 0, 1.5], [0, 0, 1.75],                         # head bottom and top: head 0.25, torso 0.5
])
# fmt: on
LENGTHS = dict(zip(PARTS, (0.5, 0.5, 0.5, 0.5, 0.25, 0.375, 0.375, 0.25, 0.25, 0.5), strict=True))


def score_parts(truth, estimate):
    """Return the parts of the people of one frame, (P, 10)."""
    return score_frames(truth[None], [estimate]).parts[0]


def wrong_parts(truth, estimate):
    """Return the names of the wrong parts of a single true person; fail if a part is undefined."""
    parts = score_parts(truth[None], np.asarray(estimate).reshape(-1, 14, 3))[0]
    assert (parts != Part.UNDEFINED).all()
    return {name for name, part in zip(PARTS, parts, strict=True) if part == Part.WRONG}


def moved(joint, by):
    estimate = PERSON.copy()
    estimate[SHELF14.index(joint)] += by
    return estimate


def test_a_perfect_estimate_has_all_parts_correct():
    assert wrong_parts(PERSON, PERSON) == set()
    assert percent(score_parts(PERSON[None], PERSON[None])) == 100.0


def test_groups_are_the_ten_parts_once_each():
    assert sorted(index for group in GROUPS.values() for index in group) == list(range(10))


@pytest.mark.parametrize("shift", [0.125, 0.126, 0.1875, 0.188, 0.25, 0.251])
def test_a_shifted_estimate_loses_the_parts_shorter_than_twice_the_shift(shift):
    lost = {name for name, length in LENGTHS.items() if shift > length / 2}
    assert wrong_parts(PERSON, PERSON + np.array([shift, 0, 0])) == lost


@pytest.mark.parametrize(
    ("joint", "part", "boundary"),
    [
        ("right_ankle", "right_lower_leg", 0.5),  # one end off by the length: the mean of the ends is half of it
        ("left_wrist", "left_lower_arm", 0.25),
        ("head_top", "head", 0.25),
    ],
)
def test_exactly_half_the_length_is_still_correct(joint, part, boundary):
    assert wrong_parts(PERSON, moved(joint, [boundary, 0, 0])) == set()
    assert wrong_parts(PERSON, moved(joint, [np.nextafter(boundary, 1), 0, 0])) == {part}


def test_the_torso_ends_between_the_hips():
    # Hips that move apart leave their middle where it was; the upper legs (0.5 m) bear 0.5 m.
    estimate = moved("right_hip", [0, -0.5, 0])
    estimate[SHELF14.index("left_hip")] += [0, 0.5, 0]
    assert wrong_parts(PERSON, estimate) == set()
    # One hip off by d moves the middle by d / 2 and so the torso (0.5 m) by d / 4.
    assert wrong_parts(PERSON, moved("left_hip", [1.0, 0, 0])) == {"left_upper_leg"}
    assert wrong_parts(PERSON, moved("left_hip", [1.001, 0, 0])) == {"left_upper_leg", "torso"}


def test_a_missing_joint_makes_its_parts_wrong_and_no_other():
    assert wrong_parts(PERSON, moved("right_knee", np.nan)) == {"right_lower_leg", "right_upper_leg"}
    assert wrong_parts(PERSON, moved("left_hip", np.nan)) == {"left_upper_leg", "torso"}
    assert wrong_parts(PERSON, moved("head_bottom", np.nan)) == {"head", "torso"}


def test_a_missing_joint_does_not_count_in_the_distance():
    incomplete = moved("right_ankle", np.nan)
    assert nearest(mean_distances(PERSON[None], np.stack([PERSON + 0.01, incomplete]))).tolist() == [1]
    nothing = np.full((14, 3), np.nan)
    assert nearest(mean_distances(PERSON[None], np.stack([nothing, PERSON + 3.0]))).tolist() == [1]
    assert nearest(mean_distances(PERSON[None], nothing[None])).tolist() == [-1]


def test_pcp_ignores_ghosts():
    ghosts = [PERSON + np.array([1, 0, 0]), PERSON - np.array([0, 2, 0])]
    assert wrong_parts(PERSON, [*ghosts, PERSON]) == set()


def test_one_estimate_is_used_for_two_people():
    truth = np.stack([PERSON, PERSON + np.array([0.0625, 0, 0])])
    assert (score_parts(truth, PERSON[None]) == Part.CORRECT).all()


def test_without_an_estimate_every_part_is_wrong():
    parts = score_parts(PERSON[None], np.zeros((0, 14, 3)))
    assert parts.shape == (1, 10)
    assert (parts == Part.WRONG).all()


def test_undefined_truth_is_not_counted():
    truth = np.stack([PERSON, np.full((14, 3), np.nan), PERSON])
    truth[2, SHELF14.index("left_wrist")] = np.nan
    for estimate in (truth[:1], np.zeros((0, 14, 3))):
        undefined = score_parts(truth, estimate) == Part.UNDEFINED
        assert undefined.sum(axis=1).tolist() == [0, 10, 1]
        assert undefined[2, PARTS.index("left_lower_arm")]
    assert percent(score_parts(truth, PERSON[None])) == 100.0
    assert percent(score_parts(truth[1:2], PERSON[None])) is None


@given(st.integers(0, 2**32 - 1))
def test_agrees_with_the_protocol_written_as_loops(seed):
    rng = np.random.default_rng(seed)
    truth = PERSON + rng.normal(0, 0.6, (3, 1, 3)) + rng.normal(0, 0.1, (3, 14, 3))
    estimate = truth[rng.integers(0, 3, 4)] + rng.normal(0, 0.15, (4, 14, 3))
    truth[rng.random(truth.shape[:2]) < 0.05] = np.nan
    estimate[rng.random(estimate.shape[:2]) < 0.05] = np.nan
    got = score_parts(truth, estimate)
    for person in range(3):
        distances = [np.nanmean([np.linalg.norm(e[j] - truth[person, j]) for j in range(14)]) for e in estimate]
        taken = estimate[int(np.argmin(distances))]
        for part, (a, b) in enumerate(((0, 1), (1, 2), (3, 4), (4, 5), (6, 7), (7, 8), (9, 10), (10, 11), (12, 13))):
            length = np.linalg.norm(truth[person, a] - truth[person, b])
            error = (np.linalg.norm(taken[a] - truth[person, a]) + np.linalg.norm(taken[b] - truth[person, b])) / 2
            expected = Part.UNDEFINED if np.isnan(length) else Part.CORRECT if error <= length / 2 else Part.WRONG
            assert got[person, part] == expected
        hips, guess = (truth[person, 2] + truth[person, 3]) / 2, (taken[2] + taken[3]) / 2
        length = np.linalg.norm(hips - truth[person, 12])
        error = (np.linalg.norm(guess - hips) + np.linalg.norm(taken[12] - truth[person, 12])) / 2
        expected = Part.UNDEFINED if np.isnan(length) else Part.CORRECT if error <= length / 2 else Part.WRONG
        assert got[person, 9] == expected


def test_a_wrong_shape_is_named():
    with pytest.raises(ValueError, match=r"estimate must be \(n, J, 3\), got \(17, 3\)"):
        score_frames(PERSON[None, None], [np.zeros((17, 3))])
