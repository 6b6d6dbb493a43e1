import numpy as np
import pytest

from simharness.statistics.resampling import block_weights, blocks, interval, resampled

TIME = np.arange(300) / 25


def test_a_resample_has_as_many_frames_and_all_frames_have_equal_weight():
    weights = block_weights(TIME, resamples=4000)
    assert weights.shape == (4000, 300)
    assert (weights.sum(axis=1) == 300).all()
    # Each of the 12 blocks of 25 contains a given one of 300 frames with probability 1/12: binomial, mean 1.
    np.testing.assert_allclose(weights.mean(axis=0), 1.0, atol=5 * np.sqrt(12 * (1 / 12) * (11 / 12) / 4000))


def test_frames_come_in_blocks():
    weights = block_weights(TIME, block=2.0, resamples=200)
    changes = (np.diff(weights, axis=1) != 0).sum(axis=1)
    assert changes.max() <= 2 * 6  # a block begins and ends once
    alone = block_weights(TIME, block=0.0, resamples=200)
    assert (np.diff(alone, axis=1) != 0).sum(axis=1).min() > 100
    assert (blocks(TIME), blocks(TIME, block=2.0), blocks(TIME, block=100.0), blocks([0.0])) == (12, 6, 1, 1)


@pytest.mark.parametrize(("frames", "step"), [(2, 0.5), (4, 0.5), (6, 0.5), (9, 1 / 3), (5, 0.2), (3, 1.0), (3, 2.0)])
def test_few_frames_make_as_many_blocks_as_they_last(frames, step):
    """Each frame lasts until the next; a longer one is a block of its own."""
    assert blocks(np.arange(frames) * step) == max(round(min(frames * step, frames)), 1)


def test_sums_of_a_resample_are_those_of_its_frames():
    rng = np.random.default_rng(0)
    values, weights = rng.normal(size=(300, 2, 3)), block_weights(TIME, resamples=5)
    expected = [np.repeat(values, row.astype(int), axis=0).sum(axis=0) for row in weights]
    np.testing.assert_allclose(resampled(values, weights), expected)


def test_a_seed_determines_the_resamples():
    np.testing.assert_array_equal(block_weights(TIME, resamples=3, seed=4), block_weights(TIME, resamples=3, seed=4))
    assert (block_weights(TIME, resamples=3, seed=4) != block_weights(TIME, resamples=3, seed=5)).any()


def test_block_intervals_cover_the_mean_of_correlated_frames_and_frame_intervals_do_not():
    """AR(1) noise with a correlation time of 0.2 s: 300 recordings of 12 s, 95 % intervals of the mean."""
    rng = np.random.default_rng(1)
    kept = np.exp(-0.04 / 0.2)
    noise = rng.normal(size=(300, 300))
    for frame in range(1, 300):
        noise[frame] = kept * noise[frame - 1] + np.sqrt(1 - kept**2) * noise[frame]
    covered = {}
    for block in (1.0, 0.0):
        weights = block_weights(TIME, block=block, resamples=400)
        low, high = interval(resampled(noise, weights) / 300, blocks=blocks(TIME, block=block))
        covered[block] = ((low <= 0) & (high >= 0)).mean()
    assert covered[1.0] > 0.89  # binomial: 0.95 would give less than 0.91 once in 2000
    assert covered[0.0] < 0.65


def test_fewer_blocks_make_wider_intervals_and_nan_is_ignored():
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
