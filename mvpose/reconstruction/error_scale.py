"""Empirical Bayes estimate of a person's keypoint error variance, from the residuals of the joints.

The error model gives the variance for a typical detector. The detector in use may be three times more accurate, and
errors on a distant or unusually dressed person may be larger. A few views suffice to estimate one scale for all joints
of a person, so this scale is estimated first; the scale of each joint then starts from it and is updated by the
residuals of that joint.
"""

from __future__ import annotations

import numpy as np

from mvpose.kernels import njit

# Errors are weighted by the responsibility of the keypoint, which truncates the tail of even a perfect Gaussian: with
# the floor at a hundredth of the peak, a tenth of the variance is lost (an integral over the two densities).
_OBSERVED_VARIANCE = 0.9
_MODEL_FREEDOM = 3.0  # residuals that the prior scale of the error model counts for, against those of a person
_PERSON_FREEDOM = 6.0  # residuals that the scale of the person counts for, against those of a joint
_LEAST, _MOST = 0.1, 4.0  # range of a person's scale; detectors do not differ from the model by more


@njit(cache=True)
def _degrees_of_freedom(responsibility):
    """Return the degrees of freedom of a joint's residuals: two per responsible view, minus three for the position."""
    return _OBSERVED_VARIANCE * max(2.0 * responsibility - 3.0, 0.0)


@njit(cache=True)
def person_scale(misfit, responsibilities):
    """Return the ratio of a person's squared keypoint errors to those of the error model.

    The prior is inverse-gamma around 1, so many residuals outweigh it and few do not.

    Args:
        misfit: sum over views of responsibility times squared error over variance, (J,).
        responsibilities: sum over views of the responsibilities, (J,).
    """
    total, freedom = _MODEL_FREEDOM, _MODEL_FREEDOM
    for j in range(len(misfit)):
        if responsibilities[j] > 1.5:
            total += misfit[j]
            freedom += _degrees_of_freedom(responsibilities[j])
    return min(max(total / freedom, _LEAST), _MOST)


@njit(cache=True)
def joint_scales(misfit, responsibilities):
    """Return the ratio of each joint's squared errors to those of the error model, (J,); see :func:`person_scale`."""
    person, scale = person_scale(misfit, responsibilities), np.empty(len(misfit))
    for j in range(len(misfit)):
        scale[j] = person
        if responsibilities[j] > 1.5:
            freedom = _PERSON_FREEDOM + _degrees_of_freedom(responsibilities[j])
            scale[j] = (_PERSON_FREEDOM * person + misfit[j]) / freedom
    return scale
