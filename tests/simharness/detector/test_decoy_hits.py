"""Decoys taken for people: how often, how long, in which views, and with which keypoints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from mvpose import Camera, Rig
from simharness.detector.draws import KeyedDraws
from simharness.detector.false_positives import MIN_JOINTS, draw_decoy_hits
from simharness.scenario.sections.detector_section import DecoyHitsSection
from simharness.types.truth import KeypointError
from simharness.types.views import LookalikeViews, Views

STEP = 0.1  # seconds
NAMES = ("poster0", "mirror0/person0")


def camera(shift):
    return Camera(np.array([[800.0, 0, 399.5], [0, 800, 299.5], [0, 0, 1]]), np.eye(3), [shift, 0, 5], size=(800, 600))


RIG = Rig([camera(0.5 * v) for v in range(3)])


def filmed(frames=300, visible=None, names=NAMES) -> Views:
    """Two decoys in three views: one is still, the other moves to the right by one pixel per frame."""
    rng = np.random.default_rng(0)
    views = len(RIG)
    still = [150.0, 150.0] + rng.random((views, len(names), 17, 2)) * [80, 240]
    pixels = np.broadcast_to(still, (frames, *still.shape)).copy()
    pixels[:, :, 1:, :, 0] += np.arange(frames)[:, None, None, None] % 300
    seen = np.ones(pixels.shape[:-1], bool) if visible is None else np.broadcast_to(visible, pixels.shape[:-1])
    none = (frames, views, 0)
    return Views(
        np.zeros((*none, 17, 2)),
        np.zeros((*none, 17), int),
        np.zeros((*none, 4)),
        np.zeros(none, int),
        np.broadcast_to(np.arange(frames)[:, None], (frames, views)),
        lookalikes=LookalikeViews(names, pixels, seen),
    )


def drawn(pictures=None, /, *, seed=2, **parameters):
    pictures = filmed() if pictures is None else pictures
    draws = KeyedDraws(seed, STEP * np.arange(len(pictures)), len(RIG))
    return draw_decoy_hits(pictures, RIG, DecoyHitsSection(**parameters), draws)


def within(count, trials, probability):
    low, high = binom.interval(1 - 1e-6, trials, probability)
    return low <= count <= high


def off(found, pictures):
    """Return the mean distance of keypoints from the decoy's true joints, (T, V, D) pixels; NaN without a hit."""
    apart = np.linalg.norm(found.keypoints - pictures.lookalikes.pixels, axis=-1)
    return np.where(found.present, apart.mean(axis=-1), np.nan)


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("views", [0.0, 0.6])
def test_decoys_are_taken_at_the_configured_rate(share, views):
    found = drawn(filmed(2000), share=share, views=views)
    assert found.present.shape == (2000, 3, 2)
    assert within(found.present[:, 0].sum(), 4000, share)  # of one view, because views share draws
    assert within(found.present[:, 2].sum(), 4000, share)


def test_the_share_is_the_same_with_a_life():
    hits = np.mean([drawn(filmed(200), share=0.3, life=0.5, seed=seed).present[::50].mean() for seed in range(100)])
    assert abs(hits - 0.3) < 5 * np.sqrt(0.21 / (100 * 4 * 6))


def test_there_are_no_hits_at_rate_zero_or_without_decoys():
    assert drawn(share=0.0).present.shape == (300, 3, 0)
    assert drawn(filmed(names=()), share=1.0).present.shape == (300, 3, 0)


@pytest.mark.parametrize("parameters", [{}, {"life": 0.5, "views": 0.5, "consistent": 0.5}])
def test_a_higher_rate_only_adds(parameters):
    few, many = drawn(share=0.2, **parameters), drawn(share=0.6, **parameters)
    assert 0 < few.present.sum() < many.present.sum()
    assert not (few.present & ~many.present).any()
    np.testing.assert_array_equal(few.keypoints[few.present], many.keypoints[few.present])
    np.testing.assert_array_equal(few.scores[few.present], many.scores[few.present])


def test_hits_last():
    life = 1.0
    present = drawn(filmed(4000), share=0.5, life=life).present
    taken = present[:-1].sum()
    kept = (present[1:] & present[:-1]).sum()
    stays = np.exp(-STEP / life) + 0.5 * (1 - np.exp(-STEP / life))  # the state lasts, or is drawn again and taken
    assert abs(kept / taken - stays) < 5 * np.sqrt(stays * (1 - stays) / (taken / 3))  # views change together
    alone = drawn(filmed(4000), share=0.5).present
    assert abs((alone[1:] & alone[:-1]).sum() / alone[:-1].sum() - 0.5) < 0.05


def test_views_agree_by_their_shared_variance():
    together, alone = (drawn(filmed(1000), share=0.4, views=views).present for views in (1.0, 0.0))
    assert (together == together[:, :1]).all()
    assert together.any()
    assert abs((alone[:, 0] & alone[:, 1]).mean() - 0.16) < 0.05


def test_decoys_with_too_few_visible_joints_are_never_taken():
    visible = np.zeros((300, 3, 2, 17), bool)
    visible[:, :, 0, : MIN_JOINTS - 1] = True
    visible[:, :, 1, :MIN_JOINTS] = True
    found = drawn(filmed(visible=visible), share=1.0)
    assert not found.present[..., 0].any()
    assert found.present[..., 1].all()
    np.testing.assert_array_equal(found.scores[..., 1, :] > 0, visible[..., 1, :])
    np.testing.assert_array_equal(np.isfinite(found.keypoints[..., 1, :, 0]), visible[..., 1, :])


def test_consistent_hits_have_the_true_joints_of_the_decoy():
    pictures = filmed()
    found = drawn(pictures, share=0.7)
    assert 0 < np.nanmax(off(found, pictures)) < 5
    apart = (found.keypoints - pictures.lookalikes.pixels)[found.present]
    assert abs(apart.mean()) < 0.1


@pytest.mark.parametrize("consistent", [0.0, 0.3, 0.8])
def test_the_share_of_consistent_hits_is_the_configured_one(consistent):
    pictures = filmed(1000)
    found = drawn(pictures, share=0.5, consistent=consistent)
    own = off(found, pictures)[found.present] < 5
    assert within(own.sum(), own.size, consistent)


def test_inconsistent_hits_keep_their_pose_and_differ_between_views():
    pictures = filmed(1000)
    found = drawn(pictures, share=1.0, consistent=0.0, life=2.0)
    assert found.present.all()
    pose = (found.keypoints - found.boxes[..., None, :2]) / found.boxes[..., None, 2:]
    np.testing.assert_allclose(np.nanmin(pose, axis=-2), 0, atol=1e-9)
    changes = np.abs(np.diff(pose, axis=0)).max(axis=(-1, -2)) > 1e-6
    assert within(changes[:, 0, 0].sum(), 999, 1 - np.exp(-STEP / 2.0))
    np.testing.assert_array_equal(changes[:, 0], changes[:, 1])
    assert (np.abs(pose[:, 0] - pose[:, 1]).max(axis=(-1, -2)) > 0.05).all()
    span = pictures.lookalikes.pixels.min(axis=-2), pictures.lookalikes.pixels.max(axis=-2)
    np.testing.assert_allclose(found.boxes[..., :2], span[0], atol=1e-9)  # it fills the box of the visible joints
    np.testing.assert_allclose(found.boxes[..., :2] + found.boxes[..., 2:], span[1], atol=1e-9)
    assert (found.keypoints[..., 0, 1] < found.keypoints[..., 15:, 1].min(axis=-1)).mean() > 0.95  # upright


def test_reported_fields_are_consistent():
    found = drawn(share=0.6, life=0.4, consistent=0.5)
    seen = found.scores[found.present] > 0
    keypoints, boxes = found.keypoints[found.present], found.boxes[found.present]
    np.testing.assert_array_equal(np.isfinite(keypoints).all(axis=-1), seen)
    assert RIG[0].inside(keypoints[seen]).all()
    np.testing.assert_allclose(np.nanmin(keypoints, axis=1), boxes[:, :2])
    np.testing.assert_allclose(np.nanmax(keypoints, axis=1), boxes[:, :2] + boxes[:, 2:])
    np.testing.assert_allclose(
        found.box_scores[found.present], found.scores[found.present].sum(axis=1) / seen.sum(axis=1)
    )
    assert (found.person == -1).all()
    assert (found.error == KeypointError.MISS).all()


def test_scores_have_the_configured_deviation_on_the_logit_scale():
    scores = drawn(filmed(2000), share=0.8, score=0.6, deviation=0.5)
    scores = scores.scores[scores.present & (scores.scores > 0).all(axis=-1)]
    logit = np.log(scores / (1 - scores))
    assert abs(logit.mean() - np.log(0.6 / 0.4)) < 5 * 0.5 / np.sqrt(len(logit))
    assert logit.std() == pytest.approx(0.5, abs=5 * 0.5 / np.sqrt(len(logit)))
    exact = drawn(share=0.8, score=0.6, deviation=0.0)
    np.testing.assert_allclose(exact.scores[exact.present], np.where(exact.scores[exact.present] > 0, 0.6, 0.0))


@pytest.mark.parametrize("parameter", [{"score": 0.3}, {"deviation": 0.1}])
def test_score_parameters_change_no_keypoint_and_no_hit(parameter):
    base, other = drawn(share=0.5, consistent=0.5), drawn(share=0.5, consistent=0.5, **parameter)
    np.testing.assert_array_equal(base.present, other.present)
    np.testing.assert_array_equal(base.keypoints, other.keypoints)


def test_consistency_changes_only_the_hits_that_it_takes():
    pictures = filmed()
    none, some = drawn(pictures, share=0.5, consistent=0.2), drawn(pictures, share=0.5, consistent=0.6)
    np.testing.assert_array_equal(none.present, some.present)
    np.testing.assert_array_equal(none.scores, some.scores)
    own = [off(found, pictures)[found.present] < 5 for found in (none, some)]
    same = (none.keypoints[none.present] == some.keypoints[none.present]).all(axis=(-1, -2))
    np.testing.assert_array_equal(~same, own[1] & ~own[0])


def test_more_decoys_change_no_other_decoy():
    """Draws are keyed by the name of the decoy."""
    pictures, parameters = filmed(), {"share": 0.5, "life": 0.5, "consistent": 0.5}
    lookalikes = pictures.lookalikes
    alone = Views(
        *(getattr(pictures, key) for key in ("pixels", "visibility", "boxes", "area_visible", "source")),
        lookalikes=LookalikeViews(NAMES[1:], lookalikes.pixels[:, :, 1:], lookalikes.visible[:, :, 1:]),
    )
    both, one = drawn(pictures, **parameters), drawn(alone, **parameters)
    np.testing.assert_array_equal(both.present[..., 1:], one.present)
    np.testing.assert_array_equal(both.keypoints[..., 1:, :, :], one.keypoints)
