"""How large the keypoint errors of a person really are, from the residuals of the joints.

The error model gives the scatter of an ordinary detector; the one at hand may be three times better, and a person in
the distance or in strange clothes may be worse off. One scale for all joints of a person is well measured by a few
views, so it is estimated first (empirical Bayes) and used; each joint's own then differs from it by what its own
residuals say.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# A keypoint's error counts as far as the keypoint is right, which cuts the tail of even a perfect Gaussian: with the
# floor at a hundredth of the peak, a tenth of the variance is not seen (an integral over the two densities).
_SEEN = 0.9
_PERSON = 3.0  # residuals that the error model's own scale is worth, against a person's
_JOINT = 6.0  # and that the person's scale is worth, against a joint's
_LEAST, _MOST = 0.1, 4.0  # of a person's scale: no detector is better or worse than the model by more


@njit(cache=True)
def _freedom(rights):
    """Residuals that are free, of views whose responsibilities sum to ``rights``: two each, less a joint's three."""
    return _SEEN * max(2.0 * rights - 3.0, 0.0)


@njit(cache=True)
def person_scale(misfit, rights):
    """How much larger the squared errors of a person are than the model's.

    Inverse-gamma about the model's: many residuals outweigh it, few do not.

    Args:
        misfit: sum over views of responsibility times squared error over variance, (J,).
        rights: sum of responsibilities, (J,).
    """
    total, freedom = _PERSON, _PERSON
    for j in range(len(misfit)):
        if rights[j] > 1.5:
            total += misfit[j]
            freedom += _freedom(rights[j])
    return min(max(total / freedom, _LEAST), _MOST)


@njit(cache=True)
def joint_scales(misfit, rights):
    """How much larger the squared errors of each joint are than the model's, (J,); see :func:`person_scale`."""
    person, scale = person_scale(misfit, rights), np.empty(len(misfit))
    for j in range(len(misfit)):
        scale[j] = (_JOINT * person + misfit[j]) / (_JOINT + _freedom(rights[j])) if rights[j] > 1.5 else person
    return scale
