import numpy as np
import pytest
from recordings import walk

from simharness.scoring.jitter import jitter

TRUTH = walk(20, 2)


def test_a_perfect_track_of_moving_people_does_not_shake():
    assert (np.linalg.norm(np.diff(TRUTH, n=2, axis=0), axis=-1) > 1e-4).any()  # they do turn
    assert jitter(TRUTH, TRUTH).shape == (18, 2, 17)
    assert (jitter(TRUTH, TRUTH) == 0).all()


def test_neither_an_offset_nor_an_even_drift_shakes():
    drift = np.arange(20)[:, None, None, None] * np.array([0.01, -0.02, 0.0])
    np.testing.assert_allclose(jitter(TRUTH, TRUTH + 0.1 + drift), 0, atol=1e-12)


def test_white_noise_shakes_by_the_closed_form():
    noise, sigma = np.random.default_rng(0), 0.02
    truth = np.zeros((3, 200_000, 3))
    shaken = jitter(truth, sigma * noise.standard_normal(truth.shape))
    assert shaken.mean() == pytest.approx(sigma * np.sqrt(6) * np.sqrt(8 / np.pi), rel=0.01)
    assert np.sqrt((shaken**2).mean() / 3) == pytest.approx(sigma * np.sqrt(6), rel=0.01)  # along each axis


def test_a_gap_says_nothing_of_the_frames_about_it():
    estimate = TRUTH.copy()
    estimate[5, 0] = np.nan
    unknown = np.isnan(jitter(TRUTH, estimate))
    assert np.flatnonzero(unknown[:, 0].all(axis=1)).tolist() == [3, 4, 5]
    assert not unknown[:, 1].any()


@pytest.mark.parametrize("frames", [1, 2])
def test_too_few_frames_have_none(frames):
    assert jitter(TRUTH[:frames], TRUTH[:frames]).shape == (0, 2, 17)
