"""People who come back by their looks: descriptors over long gaps, and never by a uniform."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from people import STANDING, ring

from mvpose import Detections, Pipeline, preset
from mvpose.affinity import AppearanceAffinity, FusedAffinity
from mvpose.tracking import Tracker, TrackerState, TrackingModel
from mvpose.tracking.reappearance import Reappearance, learn_looks, look_distances
from mvpose.tracking.tracks import Tracks

RIG = ring(5)
SPOTS = [(-1.2, -1.2), (1.2, -1.2), (-1.2, 1.2), (1.2, 1.2), (0.0, 0.0), (0.0, 1.4)]
DIMENSIONS = 64
ALIKE, DIFFERENT = 0.95, 0.3  # cosines of the clothes of two people


def _clothes(count, cosine, rng):
    """Unit vectors with one cosine between any two, (count, D)."""
    basis = np.linalg.qr(rng.standard_normal((DIMENSIONS, count + 1)))[0].T
    return np.sqrt(cosine) * basis[0] + np.sqrt(1.0 - cosine) * basis[1:]


def _frame(time, places, clothes, rng, *, same=0.8, described=True):
    """Detections of people at places, ``{person: (x, y)}``; two descriptors of one person have the cosine ``same``."""
    views, keypoints, descriptors = [], [], []
    for view, camera in enumerate(RIG):
        for person, (x, y) in places.items():
            noise = rng.standard_normal(DIMENSIONS)
            views.append(view)
            keypoints.append(camera.project(STANDING + [x, y, 0.0]) + 2.0 * rng.standard_normal((17, 2)))
            descriptors.append(np.sqrt(same) * clothes[person] + np.sqrt(1.0 - same) * noise / np.linalg.norm(noise))
    count = len(views)
    given = Detections.from_keypoints(views, np.reshape(keypoints, (count, 17, 2)), np.full((count, 17), 0.9))
    return Detections(
        given.view, given.keypoints, given.scores, given.boxes, given.box_scores, time=np.full(5, float(time)),
        descriptors=3.0 * np.reshape(descriptors, (count, DIMENSIONS)) if described else None,
    )  # fmt: skip


def _identity(estimate, place):
    """Identity of who stands at a place; -1 for nobody."""
    at = np.nanmean(estimate.joints[..., :2], axis=1) if len(estimate) else np.zeros((0, 2))
    near = np.linalg.norm(at - (STANDING[:, :2].mean(axis=0) + place), axis=1) < 0.3
    return int(estimate.ids[near.argmax()]) if near.any() else -1


def _film(before, after, clothes, *, away, seed, described=True, tracker=None):
    """Identities of people before and after all but those in both at one place are away for some seconds."""
    rng = np.random.default_rng(seed)
    tracker = tracker or Tracker(preset("fast"))
    stay = {person: place for person, place in before.items() if after.get(person) == place}
    steps = np.arange(1.0, max(away, 1.0)) if away > 4 else np.arange(0.0, away, 0.2)
    for places, times in ((before, np.arange(8) / 25), (stay, 0.3 + steps), (after, 0.3 + away + np.arange(8) / 25)):
        for time in times:
            estimate = tracker.estimate(RIG, _frame(time, places, clothes, rng, described=described))
        if places is before:
            first = {person: _identity(estimate, place) for person, place in places.items()}
    return first, {person: _identity(estimate, place) for person, place in after.items()}


def _shuffled(people, seed, *, spots=SPOTS):
    order = np.random.default_rng([9, seed]).permutation(len(spots))
    return {person: spots[order[k]] for k, person in enumerate(people)}


@pytest.mark.slow
@pytest.mark.parametrize("away", [15.0, 60.0, 300.0])
def test_who_was_away_for_long_comes_back_under_the_same_identity_where_clothes_differ(away):
    kept = []
    for seed in range(10):
        clothes = _clothes(4, DIFFERENT, np.random.default_rng([1, seed]))
        first, later = _film(_shuffled(range(4), seed), _shuffled(range(4), seed + 100), clothes, away=away, seed=seed)
        kept += [first[person] == later[person] >= 0 for person in range(4)]
    assert np.mean(kept) >= 0.95


def test_strangers_in_other_clothes_are_nobody_known():
    new = []
    for seed in range(8):
        clothes = _clothes(6, DIFFERENT, np.random.default_rng([2, seed]))
        first, later = _film(
            _shuffled([0, 1, 2], seed), _shuffled([3, 4, 5], seed + 100), clothes, away=60.0, seed=seed
        )
        new += [later[person] not in first.values() and later[person] >= 0 for person in later]
    assert np.mean(new) >= 0.95


def test_strangers_in_the_same_uniform_are_not_taken_for_those_who_left():
    new = []
    for seed in range(8):
        clothes = _clothes(6, ALIKE, np.random.default_rng([3, seed]))
        first, later = _film(
            _shuffled([0, 1, 2], seed), _shuffled([3, 4, 5], seed + 100), clothes, away=60.0, seed=seed
        )
        new += [later[person] not in first.values() and later[person] >= 0 for person in later]
    assert np.mean(new) >= 0.95


@pytest.mark.parametrize("away", [1.0, 2.0, 8.0])
def test_in_one_uniform_a_short_gap_is_bridged_as_well_as_without_descriptors(away):
    kept = {True: 0, False: 0}
    for seed in range(8):
        places = _shuffled(range(4), seed)
        clothes = _clothes(4, ALIKE, np.random.default_rng([4, seed]))
        for described in kept:
            moved = {person: (x + 0.3, y) for person, (x, y) in places.items()}
            first, later = _film(places, moved, clothes, away=away, seed=seed, described=described)
            kept[described] += sum(first[person] == later[person] for person in places)
    assert kept[True] >= kept[False] > 0


def test_two_people_who_swap_places_unseen_are_told_apart_by_their_clothes():
    places, swapped = {0: (-0.4, 0.0), 1: (0.4, 0.0)}, {0: (0.4, 0.0), 1: (-0.4, 0.0)}
    right = {True: [], False: []}
    for seed in range(6):
        clothes = _clothes(2, DIFFERENT, np.random.default_rng([5, seed]))
        for described, kept in right.items():
            first, later = _film(places, swapped, clothes, away=4.5, seed=seed, described=described)
            kept.append(first == later)
    assert all(right[True])
    assert not any(right[False])


def test_looks_are_forgotten_after_their_memory_and_saved_with_the_state(tmp_path):
    clothes = _clothes(2, DIFFERENT, np.random.default_rng(6))
    before, after = {0: SPOTS[0], 1: SPOTS[1]}, {0: SPOTS[2], 1: SPOTS[3]}
    first, later = _film(before, after, clothes, away=60.0, seed=0)
    assert first == later
    short = Tracker(preset("fast"), model=TrackingModel(reappearance=Reappearance(looks_memory=30.0)))
    first, later = _film(before, after, clothes, away=60.0, seed=0, tracker=short)
    assert not set(first.values()) & set(later.values())
    rng, tracker = np.random.default_rng(0), Tracker(preset("fast"))
    known = [tracker.estimate(RIG, _frame(k / 25, before, clothes, rng)) for k in range(8)][-1]
    for time in range(1, 30):
        tracker.estimate(RIG, _frame(time, {}, clothes, rng))
    tracker.state().save(tmp_path / "looks.npz")
    tracker = Tracker.restored(TrackerState.load(tmp_path / "looks.npz"), preset("fast"))
    back = [tracker.estimate(RIG, _frame(30 + k / 25, after, clothes, rng)) for k in range(8)][-1]
    assert {person: _identity(back, place) for person, place in after.items()} == {
        person: _identity(known, place) for person, place in before.items()
    }


def test_no_more_people_are_remembered_than_asked():
    model = TrackingModel(reappearance=Reappearance(most=5))
    tracker, rng = Tracker(preset("fast"), model=model), np.random.default_rng(0)
    clothes = _clothes(40, DIFFERENT, rng)
    for k in range(20):
        for step in range(4):
            places = {2 * k: SPOTS[k % 4], 2 * k + 1: SPOTS[(k + 1) % 4]}
            estimate = tracker.estimate(RIG, _frame(10.0 * k + step / 25, places, clothes, rng))
        assert tracker.state().lost <= 5
    assert estimate.ids.max() >= 35


@given(st.lists(st.integers(0, 500), min_size=1, max_size=12, unique=True), st.integers(1, 12))
def test_of_too_many_lost_people_those_lost_last_are_remembered(tenths, most):
    """In any order of the tracks."""
    lost = Tracks.none(joints=1, bones=0, cameras=2)
    lost = replace(lost, found=np.column_stack([np.full(len(tenths), -np.inf), 0.1 * np.array(tenths)]),
                   described=np.ones(len(tenths)))  # fmt: skip
    kept = Reappearance(most=most).remembers(lost, 60.0)
    assert set(np.array(tenths)[kept]) == set(sorted(tenths)[-most:])


def test_descriptors_may_come_late_or_be_missing_but_not_change_their_length():
    rng, tracker = np.random.default_rng(0), Tracker(preset("fast"))
    clothes, places = _clothes(2, DIFFERENT, rng), {0: SPOTS[0], 1: SPOTS[1]}
    for k in range(12):
        frame = _frame(k / 25, places, clothes, rng, described=k % 3 > 0)
        assert tracker.estimate(RIG, frame).ids.tolist() == [0, 1]
    longer = Detections(
        frame.view, frame.keypoints, frame.scores, frame.boxes, frame.box_scores, time=frame.time,
        descriptors=np.ones((len(frame), DIMENSIONS + 1)),
    )  # fmt: skip
    with pytest.raises(ValueError, match=r"descriptors must be \(m, 64\) as in earlier frames, got \(m, 65\)"):
        tracker.estimate(RIG, longer)
    assert tracker.estimate(RIG, frame).ids.tolist() == [0, 1]


def test_means_keep_the_mean_cosine_of_all_pairs():
    rng = np.random.default_rng(0)
    one, other = rng.standard_normal((7, DIMENSIONS)), rng.standard_normal((5, DIMENSIONS))
    looks, described = np.zeros((2, DIMENSIONS)), np.zeros(2)
    owner = np.r_[np.zeros(7, int), np.ones(5, int), -1, 0, 1]
    unknown = np.array([rng.standard_normal(DIMENSIONS), np.full(DIMENSIONS, np.nan), np.zeros(DIMENSIONS)])
    count = learn_looks(looks, described, owner, np.vstack([one, other, unknown]), 0.04)
    assert count.tolist() == [7, 5]
    units = [each / np.linalg.norm(each, axis=1)[:, None] for each in (one, other)]
    cosine = (units[0] @ units[1].T).mean()
    assert look_distances(looks[:1], looks[1:])[0, 0] == pytest.approx(np.sqrt(2.0 - 2.0 * cosine))
    before = looks.copy()
    learn_looks(looks, described, owner, np.vstack([one, other, unknown]), 0.04)
    np.testing.assert_allclose(looks, before, atol=1e-12)


def test_the_scale_is_that_of_the_pipeline():
    """A network whose same people are 1.2 apart: by its own scale they come back, by the general one nobody does."""
    clothes = _clothes(2, 0.05, np.random.default_rng(6))
    before, after = {0: SPOTS[0], 1: SPOTS[1]}, {0: SPOTS[2], 1: SPOTS[3]}
    for midpoint, comes_back in ((1.0, True), (0.4, False)):
        affinity = FusedAffinity(appearance=AppearanceAffinity(midpoint=midpoint))
        pipeline = Pipeline(affinity, preset("fast").matching, preset("fast").reconstruction)
        first, later = _film(before, after, clothes, away=60.0, seed=0, tracker=Tracker(pipeline))
        assert (first == later) == comes_back
