import numpy as np
import pytest
from worlds import within, world

from mvpose import COCO17
from simharness.detector.draws import KeyedDraws
from simharness.detector.keypoints import MIN_SCORE, find_keypoints, score_keypoints
from simharness.detector.viewing_conditions import Conditions
from simharness.scenario.sections.detector_section import KINDS, CorrelationSection, KeypointsSection, ScoresSection
from simharness.types.truth import KeypointError
from simharness.types.views import Visibility

USUAL = {"good": 0.9, "jitter": 0.7, "miss": 0.4, "inversion": 0.6, "swap": 0.5}


def scored(where=None, *, seed=1, parameters=None, **config):
    where = where or world(frames=200, together=True)
    parameters = parameters or {
        "scatter": 0.3,
        "jitter": 0.2,
        "miss": 0.2,
        "inversion": 0.2,
        "swap": 0.2,
        "drop": {"visible": 0.1},
    }
    conditions, tie = Conditions.of_views(where.views), CorrelationSection()
    draws = KeyedDraws(seed, where.sequence.time, len(where.rig))
    found = find_keypoints(
        where.views, conditions, where.sequence, where.rig, KeypointsSection.model_validate(parameters), tie, draws
    )
    return found, score_keypoints(
        found.error, found.guessed, conditions, ScoresSection.model_validate(config), tie, draws
    )


def test_by_default_all_scores_are_one():
    found, scores = scored()
    absent = found.error == KeypointError.ABSENT
    assert (scores[~absent] == 1).all()
    assert (scores[absent] == 0).all()
    assert absent.any()


def test_scores_follow_the_drawn_error():
    found, scores = scored(**USUAL)
    for kind in KeypointError:
        chosen = scores[found.error == kind]
        assert len(chosen) > 100
        np.testing.assert_allclose(chosen, USUAL.get(kind.name.lower(), 0.0))


def test_scores_have_the_configured_deviation_on_the_logit_scale():
    found, scores = scored(**USUAL, deviation=0.5)
    for kind, usual in USUAL.items():
        logits = scores[found.error == KeypointError[kind.upper()]]
        logits = np.log(logits / (1 - logits))
        assert np.median(logits) == pytest.approx(np.log(usual / (1 - usual)), abs=0.08)
        assert logits.std() == pytest.approx(0.5, rel=0.1)


@pytest.mark.parametrize(
    ("parameter", "error", "score"),
    [("overconfident", KeypointError.MISS, 0.9), ("underconfident", KeypointError.GOOD, 0.4)],
)
def test_some_misses_are_overconfident_and_some_good_keypoints_unsure(parameter, error, score):
    found, scores = scored(**USUAL, **{parameter: 0.3})
    _, usual = scored(**USUAL)
    chosen = found.error == error
    assert within((scores[chosen] == score).sum(), chosen.sum(), 0.3)
    np.testing.assert_array_equal(scores[~chosen], usual[~chosen])


def test_guesses_may_be_overconfident():
    where = world(frames=200, visibility=Visibility.OCCLUDED_BY_CLUTTER)
    found, scores = scored(where, parameters={"guess": {"occluded": 0.5}}, **USUAL, hidden=0.5, overconfident=1.0)
    assert found.guessed.any()
    assert (scores[found.guessed] == 0.9).all()


def test_guesses_have_separate_scores_by_kind_of_joint():
    seen = np.broadcast_to(
        np.where(np.arange(17) < 11, Visibility.VISIBLE, Visibility.OCCLUDED_BY_PERSON), (100, 3, 2, 17)
    )
    where, errors = world(frames=100, visibility=seen), {"guess": {"occluded": 0.5}, "miss": 0.2}
    scale = {"hidden": 0.5, "joint": 0.9}
    found, scores = scored(where, parameters=errors, **USUAL, **scale, guess={"hips": 0.5, "knees": 0.4, "ankles": 0.1})
    for joints, score in (([11, 12], 0.5), ([13, 14], 0.4), ([15, 16], 0.1)):
        guessed = found.guessed[..., joints]
        assert within(guessed.sum(), guessed.size, 0.5)
        np.testing.assert_allclose(scores[..., joints][guessed], score)
    _, others = scored(where, parameters=errors, **USUAL, **scale)
    np.testing.assert_array_equal(scores[~found.guessed], others[~found.guessed])


def test_guesses_outside_the_image_have_a_factor():
    seen = np.broadcast_to(np.where(np.arange(17) < 13, Visibility.VISIBLE, Visibility.OUTSIDE), (20, 3, 2, 17))
    where = world(frames=20, visibility=seen)
    _, scores = scored(where, parameters={"guess": {"outside": 1.0}}, good=0.8, guess=0.6, outside=0.5)
    np.testing.assert_allclose(scores[..., 13:], 0.3)
    np.testing.assert_allclose(scores[..., :13], 0.8)


def test_hidden_joints_have_a_factor_for_each_class():
    where = world(frames=200, together=True, visibility=Visibility.SELF_OCCLUDED)
    errors = {key: 0.2 for key in ("jitter", "miss", "inversion", "swap")}
    factors = {"good": 0.9, "jitter": 0.8, "miss": 0.3, "inversion": 0.7, "swap": 0.6}
    found, scores = scored(where, parameters=errors, **USUAL, hidden=factors)
    for kind, factor in factors.items():
        chosen = scores[found.error == KeypointError[kind.upper()]]
        assert len(chosen) > 100
        np.testing.assert_allclose(chosen, USUAL[kind] * factor)
    _, whole = scored(where, parameters=errors, **USUAL, hidden=0.5)
    _, plain = scored(where, parameters=errors, **USUAL)
    np.testing.assert_allclose(whole, 0.5 * plain)  # one number is the factor of all classes


def test_hidden_joints_and_kinds_of_joints_have_factors():
    seen = np.full((20, 3, 2, 17), Visibility.VISIBLE)
    seen[..., 7:9] = Visibility.SELF_OCCLUDED
    _, scores = scored(world(frames=20, visibility=seen), parameters={"scatter": 0.1}, good=0.8, hidden=0.5)
    np.testing.assert_allclose(scores[..., 7:9], 0.4)
    np.testing.assert_allclose(np.delete(scores, [7, 8], axis=-1), 0.8)
    _, scores = scored(
        world(frames=20), parameters={"scatter": 0.1}, good=0.8, joint={**dict.fromkeys(KINDS, 1.0), "hips": 0.5}
    )
    for joint, name in enumerate(COCO17.joints):
        np.testing.assert_allclose(scores[..., joint], 0.4 if "hip" in name else 0.8)


def test_scores_are_in_range_and_positive_where_reported():
    found, scores = scored(**USUAL, deviation=5.0, overconfident=0.3, underconfident=0.3)
    reported = found.error != KeypointError.ABSENT
    assert (scores[reported] >= MIN_SCORE).all()
    assert scores.max() <= 1
    assert (scores[~reported] == 0).all()
