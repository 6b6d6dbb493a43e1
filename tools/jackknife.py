"""Pseudo-values of the jackknife, by which intervals of means apply to ratios and other figures of sums."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mvpose.arrays import Floats


def pseudo_values(figure: Callable[[Floats], Floats], sums: ArrayLike) -> Floats:
    """Return the pseudo-value of each scene, (n,), whose mean and deviation are those of a figure of sums.

    The pseudo-value is n times the figure of all scenes minus n - 1 times that of all but this one (Tukey, "Bias and
    confidence in not quite large samples", Annals of Mathematical Statistics 1958). For a mean it is the scene's value.
    Intervals and tests of means so apply to ratios and other smooth figures.

    Args:
        figure: function of sums, ``(..., *shape)``, that returns figures, ``(...)``.
        sums: contribution of each scene, ``(n, *shape)``.
    """
    sums = np.asarray(sums, float)
    n, whole = len(sums), sums.sum(axis=0)
    return np.asarray(n * figure(whole) - (n - 1) * figure(whole - sums), float)
