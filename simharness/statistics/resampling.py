"""Resampling: block bootstrap of frames, which are correlated, and jackknife of scenes, which are not.

Frames are drawn in blocks longer than the correlation (Künsch, "The jackknife and the bootstrap for general stationary
observations", Annals of Statistics 1989); all quantities of a frame are drawn together. Figures that are functions of
sums over frames are computed for all resamples at once: ``f(weights @ sums)``.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t

from mvpose.arrays import Floats
from simharness.types.random_streams import stream

BLOCK = 1.0
"""Default length of a block, seconds: longer than poses, occlusions and most errors last."""


def blocks(time: ArrayLike, *, block: float = BLOCK) -> int:
    """Return the number of blocks of ``block`` seconds in frames at ``time`` (T,) seconds; at least 1."""
    frames = len(np.asarray(time))
    return max(1, round(frames / _frames_per_block(np.asarray(time, float), block))) if frames else 1


def block_weights(time: ArrayLike, *, block: float = BLOCK, resamples: int = 1000, seed: int = 0) -> Floats:
    """Return how many times each resample contains each frame, (R, T); each row sums to T.

    A block can begin at any frame and continues from the last frame at the first, so that all frames have equal weight.

    Args:
        time: times of the frames, (T,) seconds, evenly spaced.
        block: length of a block, seconds.
        resamples: number of resamples, R.
        seed: seed of the draws.

    Raises:
        ValueError: no frames.
    """
    time = np.asarray(time, float)
    frames = len(time)
    if not frames:
        raise ValueError("no frames to resample")
    length = _frames_per_block(time, block)
    count = -(-frames // length)
    starts = stream(seed, "bootstrap").integers(frames, size=(resamples, count))
    drawn = (starts[:, :, None] + np.arange(length)).reshape(resamples, -1)[:, :frames] % frames
    rows = np.arange(resamples)[:, None] * frames
    return np.bincount((rows + drawn).ravel(), minlength=resamples * frames).reshape(resamples, frames).astype(float)


def resampled(sums: ArrayLike, weights: Floats) -> Floats:
    """Return the sums over the frames of each resample, (R, ...), from the contribution of each frame, (T, ...)."""
    sums = np.asarray(sums, float)
    return (weights @ sums.reshape(len(sums), -1)).reshape(len(weights), *sums.shape[1:])


def interval(values: ArrayLike, *, level: float = 0.95, blocks: int | None = None) -> tuple[Floats, Floats]:
    """Return the percentile interval of resampled figures (R, ...) as two arrays (...), low and high; NaN is ignored.

    Args:
        values: figure of each resample.
        level: coverage probability of the interval.
        blocks: number of independent blocks. The fewer, the wider the interval, in the ratio of Student's t to the
            normal distribution (expanded percentiles; Hesterberg, The American Statistician 2015). None: not widened.
    """
    values = np.asarray(values, float)
    tail = (1 - level) / 2
    if blocks is not None and blocks > 1:
        tail = float(norm.cdf(-np.sqrt(blocks / (blocks - 1)) * t.isf(tail, blocks - 1)))
    flat = values.reshape(len(values), -1)
    ends = np.full((2, flat.shape[1]), np.nan)
    known = np.isfinite(flat).any(axis=0)
    if known.any():
        ends[:, known] = np.nanquantile(flat[:, known], [tail, 1 - tail], axis=0)
    low, high = ends.reshape(2, *values.shape[1:])
    return low, high


def _frames_per_block(time: Floats, block: float) -> int:
    """Return the number of frames in a block."""
    step = (time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else block
    return int(np.clip(round(block / step), 1, len(time))) if step > 0 else 1
