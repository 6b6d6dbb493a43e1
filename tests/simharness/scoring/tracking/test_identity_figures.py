"""Closed forms of the scores of identities: a change halfway, people who swap, gaps, ghosts, distances."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trackeval_oracle import random_case

from mvpose import COCO17, SHELF14, Estimate, Matching
from simharness.scoring.tracking.identity_figures import COUNTS, SHARES, identity_figures
from simharness.scoring.tracking.identity_scores import ABSENT, MISSED, clear_mot, hota, identity_scores
from simharness.scoring.tracking.tracked_frames import ids_of, roots, tracked_frames

RATE = 10.0
BODY = np.random.default_rng(0).normal(0, 0.3, (17, 3))


def people_at(*places, frames):
    """Return joints of people who stand, (T, P, 17, 3)."""
    return np.tile(np.array(places, float)[None, :, None] + BODY, (frames, 1, 1, 1))


def figures(truth, joints, ids, *, distance=0.5, **options):
    frames = tracked_frames(truth, joints, ids, skeleton=COCO17, **options)
    return identity_figures(frames, np.arange(len(truth)) / RATE, distance=distance)


def test_an_identity_that_changes_halfway_counts_half():
    truth = people_at([0, 0, 0], frames=20)
    found = figures(truth, truth, [[7]] * 10 + [[9]] * 10)
    assert (found["idf1"], found["idp"], found["idr"]) == (0.5, 0.5, 0.5)
    assert (found["deta"], found["assa"], found["loca"]) == pytest.approx((1.0, 0.5, 1.0))
    assert found["hota"] == pytest.approx(np.sqrt(0.5))
    assert found["mota"] == pytest.approx(1 - 1 / 20)
    assert (found["id_switches"], found["fragmentations"]) == (1, 0)
    assert found["switches_per_minute"] == pytest.approx(60 * RATE / 20)


def test_two_people_who_swap_identities_are_two_switches():
    truth = people_at([0, 0, 0], [2, 0, 0], frames=30)
    frames = tracked_frames(truth, truth, [[1, 2]] * 10 + [[2, 1]] * 20, skeleton=COCO17)
    pairs, names = clear_mot(frames, distance=0.5), identity_scores(frames, distance=0.5)
    assert np.argwhere(pairs.switched).tolist() == [[10, 0], [10, 1]]
    assert frames.ids[names.track].tolist() == [2, 1]
    assert names.right == 40
    assert hota(frames, distance=0.5).association == pytest.approx(np.full(19, (10 * 10 / 50 + 20 * 20 / 40) / 30))


def test_estimates_have_identities_only_if_all_frames_have():
    named = [
        Estimate(np.zeros((1, 17, 3)), np.ones((1, 17)), Matching(np.zeros(0, int)), ids=np.array([k]))
        for k in range(3)
    ]
    nameless = replace(named[0], ids=None)
    assert [each.tolist() for each in ids_of(named) or []] == [[0], [1], [2]]
    assert [ids_of(each) for each in ([], [nameless], [named[0], nameless, named[1]])] == [None] * 3


def test_gaps_and_absence():
    """A person who is found again is a fragment; tracks tell absent people from missed ones."""
    truth = people_at([0, 0, 0], [2, 0, 0], frames=6)
    truth[3, 1] = np.nan
    ids = [[1, 2], [2], [1, 2], [1], [1, 2], [1, 2]]
    joints = [truth[0], truth[1, 1:], truth[2], truth[3, :1], truth[4], truth[5]]
    frames = tracked_frames(truth, joints, ids, skeleton=COCO17)
    pairs = clear_mot(frames, distance=0.5)
    assert pairs.track.T.tolist() == [[0, MISSED, 0, 0, 0, 0], [1, 1, 1, ABSENT, 1, 1]]
    assert (pairs.fragmentations, pairs.switches, pairs.missed, pairs.false) == (2, 0, 1, 0)
    assert pairs.interruptions == 1  # person 1 was absent, not missed
    assert frames.frames_of_people.tolist() == [6, 5]


def test_a_ghost_costs_precision_and_not_recall():
    truth = people_at([0, 0, 0], frames=10)
    ghost = people_at([0, 0, 0], [9, 0, 0], frames=10)
    found = figures(truth, ghost, [[1, 5]] * 10)
    assert (found["idr"], found["idp"], found["mota"]) == (1.0, 0.5, 0.0)
    assert found["deta"] == pytest.approx(0.5)
    assert found["assa"] == pytest.approx(1.0)


@pytest.mark.parametrize("distance", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("place", ["mean_joint", "root"])
def test_an_estimate_at_the_distance_is_half_similar(distance, place):
    truth = people_at([0, 0, 0], frames=5)
    for off, similarity in ((0.0, 1.0), (0.5, 0.75), (0.999, 0.5005), (1.001, 0.4995), (2.0, 0.0)):
        moved = truth + [0.6 * off * distance, 0, 0.8 * off * distance]
        frames = tracked_frames(truth, moved, [[1]] * 5, skeleton=COCO17, place=place)
        assert frames.similarities(distance)[0] == pytest.approx(np.array([[similarity]]))
        found = identity_figures(frames, np.arange(5) / RATE, distance=distance)
        assert found["idr"] == (1.0 if off < 1 else 0.0)
        assert found["hota"] == pytest.approx(np.sum(np.arange(1, 20) * 0.05 <= similarity + 1e-9) / 19)


def test_the_root_is_the_middle_of_the_hips():
    joints = np.arange(17.0)[:, None] * [1.0, 0, 2.0]
    assert roots(joints, COCO17).tolist() == [[11.5, 0, 23.0]]
    assert roots(joints[:14], SHELF14).tolist() == [[2.5, 0, 5.0]]


def test_arms_count_for_the_mean_joint_and_not_for_the_root():
    truth = people_at([0, 0, 0], frames=4)
    spread = truth.copy()
    spread[:, :, :9] += [0, 1.2, 0]  # nine joints are off by 1.2 m: 0.64 m on average
    assert figures(truth, spread, [[1]] * 4)["idr"] == 0.0
    assert figures(truth, spread, [[1]] * 4, place="root")["idr"] == 1.0


@given(st.integers(0, 999))
def test_names_of_identities_and_the_order_of_estimates_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    truth, joints, ids = random_case(seed)
    names = rng.permutation(5000)
    orders = [rng.permutation(len(each)) for each in ids]
    shuffled = [each[order] for each, order in zip(joints, orders, strict=True)]
    renamed = [names[each[order]] for each, order in zip(ids, orders, strict=True)]
    before, after = figures(truth, joints, ids), figures(truth, shuffled, renamed)
    assert before == pytest.approx(after, nan_ok=False)


@given(st.integers(0, 999))
def test_scores_are_within_their_bounds(seed):
    found = figures(*random_case(seed))
    for key in SHARES:
        if found[key] is not None:
            assert (-np.inf if key == "mota" else 0.0) <= found[key] <= 1.0
    if found["hota"] is not None:
        assert found["hota"] ** 2 <= min(found["deta"], 1.0) + 1e-9
        shares = (found["idp"] or 0.0, found["idr"])
        assert min(shares) - 1e-9 <= found["idf1"] <= max(shares) + 1e-9


def test_figures_that_do_not_apply_are_none():
    nobody = figures(np.full((3, 1, 17, 3), np.nan), [BODY[None]] * 3, [[1]] * 3)
    assert nobody == dict.fromkeys((*SHARES, *COUNTS))
    missed = figures(people_at([0, 0, 0], frames=3), [np.zeros((0, 17, 3))] * 3, [[]] * 3)
    assert {key for key, value in missed.items() if value is None} == {"idp", "loca"}
    assert missed["hota"] == missed["idr"] == missed["mota"] == missed["id_switches"] == 0.0
    assert figures(people_at([0, 0, 0], frames=1), [BODY[None]], [[1]])["switches_per_minute"] is None


def test_bad_input():
    truth = people_at([0, 0, 0], frames=2)
    twice = np.concatenate([truth[0], truth[0]])
    with pytest.raises(ValueError, match="frame 1 has 2 estimates of identity 4"):
        tracked_frames(truth, [truth[0], twice], [[4], [4, 4]], skeleton=COCO17)
    with pytest.raises(ValueError, match="joints and ids of 2 frames, got 1 and 2"):
        tracked_frames(truth, [truth[0]], [[1], [1]], skeleton=COCO17)
    with pytest.raises(ValueError, match=r"ids of frame 0 must be \(1"):
        tracked_frames(truth, truth, [[1, 2], [1]], skeleton=COCO17)
    with pytest.raises(ValueError, match="place must be one of mean_joint, root, got 'head'"):
        tracked_frames(truth, truth, [[1], [1]], skeleton=COCO17, place="head")
