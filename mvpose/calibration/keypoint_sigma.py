"""Standard deviation of keypoints in pixels, by joint, size of the person and score.

The error model is that of :class:`mvpose.reconstruction.likelihood.Noise`, in pixels instead of metres: an adult has an
area of (0.70 m)², so the size of a person in the picture gives the pixels per metre at the person.
"""

from __future__ import annotations

import numpy as np

from mvpose.arrays import Floats
from mvpose.reconstruction.likelihood import Noise
from mvpose.skeleton import Skeleton

_NOISE = Noise()
_BOX_SHARE = 0.53  # fraction of its box that a person fills (Ronchi & Perona, ICCV 2017)
_LOWEST_SCORE = 0.2  # a keypoint of a lower score is not less accurate: it is right or grossly wrong


def keypoint_sigma(
    keypoints: Floats,
    scores: Floats,
    skeleton: Skeleton,
    *,
    noise: Noise = _NOISE,
) -> tuple[Floats, Floats]:
    """Return the area of each person, (n,), pixels², and the standard deviation of keypoints, (n, J), pixels.

    The area is that of the box around the keypoints, without the fifth of them that are farthest from the median, times
    the share of the box that a person fills. Where only few joints are detected it is too small.

    Args:
        keypoints: pixels, (n, J, 2); NaN where missing.
        scores: scores, (n, J); a keypoint of half the score has twice the standard deviation.
        skeleton: the J joints.
        noise: error model.

    Returns:
        Areas and standard deviations; the latter are infinite where the keypoint is missing.
    """
    detected = scores > 0
    if not len(keypoints):
        return np.zeros(0), np.zeros(scores.shape)
    center = np.nanmedian(keypoints, axis=1, keepdims=True)
    away = np.abs(keypoints - center).max(axis=-1)
    near = detected & (away <= 5.0 * np.nanmedian(away, axis=1, keepdims=True))
    low = np.where(near[..., None], keypoints, np.inf).min(axis=1)
    high = np.where(near[..., None], keypoints, -np.inf).max(axis=1)
    sides = np.maximum(high - low, 1.0)
    # A person seen from the side, or of whom one part is detected, has a narrow box: no side counts as less than a
    # quarter of the other.
    sides = np.maximum(sides, 0.25 * sides[:, ::-1])
    area = _BOX_SHARE * sides.prod(axis=1)
    relative = noise.sigmas(skeleton) / noise.area
    sigma = np.hypot(np.sqrt(area)[:, None] * relative, noise.pixels) / np.maximum(scores, _LOWEST_SCORE)
    return area, np.where(detected, sigma, np.inf)
