"""Confidence intervals of figures from recordings, in which one frame is much like the next.

Frames are drawn in blocks that are longer than what lasts (a block bootstrap; Künsch, Annals of Statistics 1989), and
everything that was seen in a frame goes together. Figures that are functions of sums over frames are computed for all
resamples at once: ``f(weights @ sums)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t

from mvpose.arrays import Floats
from simharness.types.random_streams import stream

BLOCK = 1.0
"""Seconds, the usual length of a block: poses, occlusions and most errors last less."""


def blocks(time: ArrayLike, *, block: float = BLOCK) -> int:
    """How many blocks of ``block`` seconds there are in frames at ``time`` (T,) seconds; at least 1."""
    frames = len(np.asarray(time))
    return max(1, round(frames / _length(np.asarray(time, float), block))) if frames else 1


def block_weights(time: ArrayLike, *, block: float = BLOCK, resamples: int = 1000, seed: int = 0) -> Floats:
    """How often each frame counts in each resample, (R, T); a row sums to T.

    Blocks begin anywhere and run on from the last frame to the first, so that every frame counts equally.

    Args:
        time: of the frames, (T,) seconds, evenly spaced.
        block: length of the blocks, seconds.
        resamples: R.
        seed: of the draws.

    Raises:
        ValueError: no frames.
    """
    time = np.asarray(time, float)
    frames = len(time)
    if not frames:
        raise ValueError("no frames to resample")
    length = _length(time, block)
    count = -(-frames // length)
    starts = stream(seed, "bootstrap").integers(frames, size=(resamples, count))
    drawn = (starts[:, :, None] + np.arange(length)).reshape(resamples, -1)[:, :frames] % frames
    rows = np.arange(resamples)[:, None] * frames
    return np.bincount((rows + drawn).ravel(), minlength=resamples * frames).reshape(resamples, frames).astype(float)


def resampled(sums: ArrayLike, weights: Floats) -> Floats:
    """Sums over the frames of each resample, (R, ...), of what each frame adds, (T, ...)."""
    sums = np.asarray(sums, float)
    return (weights @ sums.reshape(len(sums), -1)).reshape(len(weights), *sums.shape[1:])


def interval(values: ArrayLike, *, level: float = 0.95, blocks: int | None = None) -> tuple[Floats, Floats]:
    """Percentile interval of resampled figures (R, ...): two arrays (...); NaN among the values is left out.

    Args:
        values: the figure of each resample.
        level: how often the interval should hold the truth.
        blocks: how many independent blocks there were: the fewer, the wider, as Student's t is wider than the normal
            distribution (expanded percentiles; Hesterberg, The American Statistician 2015). None: not widened.
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


def _length(time: Floats, block: float) -> int:
    """Frames in a block."""
    step = (time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else block
    return int(np.clip(round(block / step), 1, len(time))) if step > 0 else 1
