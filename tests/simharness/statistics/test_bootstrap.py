import numpy as np
import pytest

from simharness.statistics.bootstrap import block_weights, blocks, interval, resampled

TIME = np.arange(300) / 25


def test_a_resample_has_as_many_frames_and_every_frame_counts_alike():
    weights = block_weights(TIME, resamples=4000)
    assert weights.shape == (4000, 300)
    assert (weights.sum(axis=1) == 300).all()
    # A frame counts as often as 12 blocks of 25 of 300 hold it: 1 on average, with the variance of a binomial.
    np.testing.assert_allclose(weights.mean(axis=0), 1.0, atol=5 * np.sqrt(12 * (1 / 12) * (11 / 12) / 4000))


def test_frames_come_in_blocks():
    weights = block_weights(TIME, block=2.0, resamples=200)
    changes = (np.diff(weights, axis=1) != 0).sum(axis=1)
    assert changes.max() <= 2 * 6  # a block begins and ends once
    alone = block_weights(TIME, block=0.0, resamples=200)
    assert (np.diff(alone, axis=1) != 0).sum(axis=1).min() > 100
    assert (blocks(TIME), blocks(TIME, block=2.0), blocks(TIME, block=100.0), blocks([0.0])) == (12, 6, 1, 1)


def test_sums_of_a_resample_are_those_of_its_frames():
    rng = np.random.default_rng(0)
    values, weights = rng.normal(size=(300, 2, 3)), block_weights(TIME, resamples=5)
    expected = [np.repeat(values, row.astype(int), axis=0).sum(axis=0) for row in weights]
    np.testing.assert_allclose(resampled(values, weights), expected)


def test_one_seed_is_one_resample():
    np.testing.assert_array_equal(block_weights(TIME, resamples=3, seed=4), block_weights(TIME, resamples=3, seed=4))
    assert (block_weights(TIME, resamples=3, seed=4) != block_weights(TIME, resamples=3, seed=5)).any()


def test_intervals_hold_the_mean_of_what_lasts_and_frames_alone_do_not():
    """A share that forgets in 0.2 s, 300 recordings of 12 s: a 95 % interval holds its mean about as often."""
    rng = np.random.default_rng(1)
    kept = np.exp(-0.04 / 0.2)
    noise = rng.normal(size=(300, 300))
    for frame in range(1, 300):
        noise[frame] = kept * noise[frame - 1] + np.sqrt(1 - kept**2) * noise[frame]
    held = {}
    for block in (1.0, 0.0):
        weights = block_weights(TIME, block=block, resamples=400)
        low, high = interval(resampled(noise, weights) / 300, blocks=blocks(TIME, block=block))
        held[block] = ((low <= 0) & (high >= 0)).mean()
    assert held[1.0] > 0.89  # binomial: 0.95 would give less than 0.91 once in 2000
    assert held[0.0] < 0.65


def test_fewer_blocks_make_wider_intervals_and_unknown_ones_are_left_out():
    values = np.random.default_rng(2).normal(size=(20000, 1))
    plain, few, many = (interval(values, blocks=count) for count in (None, 6, 10000))
    np.testing.assert_allclose(np.ravel(plain), [-1.96, 1.96], atol=0.06)
    np.testing.assert_allclose(np.ravel(many), np.ravel(plain), atol=0.02)
    # Student's t with 5 degrees of freedom, times sqrt(6 / 5).
    np.testing.assert_allclose(np.ravel(few), [-2.816, 2.816], atol=0.15)
    gaps = np.where(np.arange(20000)[:, None] % 2, np.nan, values)
    np.testing.assert_allclose(np.ravel(interval(gaps)), [-1.96, 1.96], atol=0.1)
    assert np.isnan(interval(np.full((9, 1), np.nan))).all()


def test_no_frames_are_refused():
    with pytest.raises(ValueError, match="no frames to resample"):
        block_weights([])
