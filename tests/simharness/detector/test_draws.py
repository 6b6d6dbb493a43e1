import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtri
from scipy.stats import kstest

from simharness.detector.draws import LIMB_OF_JOINT, KeyedDraws, logistic

TIME = np.arange(4000) / 10.0


@pytest.mark.parametrize("life", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("shared", [0.0, 0.4, 1.0])
def test_events_have_the_configured_rate_at_any_sharing_and_life(life, shared):
    states = np.concatenate(
        [KeyedDraws(seed, TIME[:400], 3).states("x", life=life, shared=shared)[::10] for seed in range(60)]
    )
    for probability in (0.05, 0.3):
        # Held or shared draws are fewer: the bound is for the number of independent draws.
        independent = len(states) * (3 if shared == 0 else 1) / max(1.0, 2 * life)
        share = (states < ndtri(probability)).mean()
        assert abs(share - probability) < 4.5 * np.sqrt(probability * (1 - probability) / independent)


@pytest.mark.parametrize("shared", [0.0, 0.3, 0.7, 1.0])
def test_views_share_the_configured_variance(shared):
    states = KeyedDraws(1, TIME, 2).joint_states("x", 0, shared=shared)
    assert np.corrcoef(states[:, 0].ravel(), states[:, 1].ravel())[0, 1] == pytest.approx(shared, abs=0.015)
    assert states.std() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("limb", [0.0, 0.5, 1.0])
def test_joints_share_variance_with_their_limb_only(limb):
    states = KeyedDraws(2, TIME, 1).joint_states("x", 0, limb=limb)[:, 0]
    correlation = np.corrcoef(states.T)
    same = LIMB_OF_JOINT[:, None] == LIMB_OF_JOINT
    np.fill_diagonal(correlation, np.nan)
    np.testing.assert_allclose(np.nanmean(correlation[same]), limb, atol=0.02)
    np.testing.assert_allclose(np.nanmean(correlation[~same]), 0.0, atol=0.02)


@pytest.mark.parametrize("life", [0.3, 1.0, 4.0])
def test_states_have_the_configured_life(life):
    states = np.stack([KeyedDraws(seed, TIME, 1).states("x", life=life)[:, 0] for seed in range(5)])
    changes = (np.diff(states, axis=1) != 0).mean()
    # Observed at 10 Hz, a life of mean L ends between two frames with probability 1 - exp(-0.1 / L).
    assert changes == pytest.approx(-np.expm1(-0.1 / life), rel=0.1)


def test_states_with_the_same_lives_change_together_and_others_do_not():
    draws = KeyedDraws(3, TIME, 2)
    one, two = (draws.joint_states(name, lives=("joint",), life=1.0) for name in "ab")
    other = draws.joint_states("a", life=1.0)
    changed = np.diff(one, axis=0) != 0
    np.testing.assert_array_equal(changed, np.diff(two, axis=0) != 0)
    assert (changed[:, 0] == changed[:, 1]).all()
    assert (changed != (np.diff(other, axis=0) != 0)).any()


def test_autoregressive_numbers_have_the_configured_correlation():
    values = KeyedDraws(4, TIME, 1).autoregressive("x", shape=(40,), life=0.8)
    assert values.std() == pytest.approx(1.0, abs=0.05)
    for lag in (1, 5, 10):
        seen = (values[lag:] * values[:-lag]).mean()
        assert seen == pytest.approx(np.exp(-lag * 0.1 / 0.8), abs=0.04)
    assert kstest(values[::100].ravel(), "norm").pvalue > 1e-4


def test_more_frames_or_views_change_no_draw():
    short, long = (KeyedDraws(5, TIME[:n], views) for n, views in ((50, 2), (90, 4)))
    for draw in (
        lambda draws: draws.joint_states("x", 0, life=0.5, shared=0.3, limb=0.2)[:, :2],
        lambda draws: draws.autoregressive("y", shape=(3,), life=0.5),
        lambda draws: draws.uniform("z", shape=(2,)),
    ):
        np.testing.assert_array_equal(draw(short), draw(long)[:50])


def test_a_single_frame():
    one = KeyedDraws(6, TIME[:1], 2)
    assert one.states("x", life=1.0).shape == (1, 2)
    assert one.autoregressive("x", life=1.0).shape == (1,)


@given(st.floats(0.0, 1.0), st.floats(-30, 30))
def test_scores_keep_their_range_and_order(usual, spread):
    score = logistic(usual, spread)
    assert 0 <= score <= 1
    assert logistic(usual, 0.0) == pytest.approx(usual)
    assert logistic(usual, spread + 1) >= score
    assert logistic(usual, -spread) == pytest.approx(1 - logistic(1 - usual, spread), abs=1e-9)
