"""How much estimates shake from frame to frame.

With the error e(t) = estimate - truth of a joint, its jitter at t is ``|e(t - 1) - 2 e(t) + e(t + 1)|``. People may
move as they like and an estimate may be off or lag behind evenly: neither shakes. Independent noise of standard
deviation s along each axis makes each component s sqrt(6), and the mean of the norm s sqrt(6) x sqrt(8 / pi), about
3.9 s.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def jitter(truth: ArrayLike, estimate: ArrayLike) -> NDArray[np.float64]:
    """The jitter of joints over evenly spaced frames.

    Args:
        truth: (T, ..., 3).
        estimate: (T, ..., 3), in the same unit; NaN where missing.

    Returns:
        (T - 2, ...), none of fewer than three frames; NaN where one of the three is missing.
    """
    error = np.asarray(estimate, float) - np.asarray(truth, float)
    return np.linalg.norm(np.diff(error, n=2, axis=0), axis=-1)
