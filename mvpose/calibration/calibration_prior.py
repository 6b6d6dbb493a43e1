"""Prior on the errors of the believed cameras: heavy tails, and a width that the cameras share.

The data do not fix the place, the orientation and the size of the whole rig; the prior does. The errors of each camera
have a Student distribution: where most cameras agree with each other, they keep their places, and one that was moved
takes the whole correction, as in a least sum of distances; where all cameras are off, the correction is spread over
them, as by least squares. The width of the distribution is estimated with the cameras (empirical Bayes), so that
intervals are narrow where the other cameras prove to be right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mvpose.arrays import Bools, Floats
from mvpose.calibration.normal_equations import CENTER, CLOCK, FOCAL, K1, PARAMETERS, POSE, ROTATION, TRANSLATION

GROUPS = (POSE, CLOCK, FOCAL, CENTER, K1)
"""Parameters of a camera that are off together."""

_SHARED = (POSE, CLOCK)  # groups whose width is estimated
_FREEDOM = 4.0  # of the Student distribution of each camera's errors
_BELIEF = 6.0  # numbers that the expected width of the distribution is worth: those of one camera's pose
_WIDE = 10.0  # width in the first step: 2 degrees, 0.2 m


@dataclass(frozen=True)
class Prior:
    """Errors of a careful calibration: standard deviations of the body of the distribution, whose tails are heavy.

    Rotations and positions after calibration with a board are off by 0.2 degrees and 5 to 19 mm, focal lengths by 0.3
    to 1.3 % (caliscope).

    Attributes:
        rotation: radians.
        translation: metres.
        clock: seconds.
        focal: relative.
        center: pixels.
        k1: of the lens.
    """

    rotation: float = float(np.radians(0.2))
    translation: float = 0.02
    clock: float = 0.01
    focal: float = 0.005
    center: float = 5.0
    k1: float = 0.02

    def sigmas(self) -> Floats:
        """Return the standard deviation of each parameter of a camera, (11,)."""
        result = np.empty(PARAMETERS)
        result[ROTATION], result[TRANSLATION], result[CLOCK] = self.rotation, self.translation, self.clock
        result[FOCAL], result[CENTER], result[K1] = self.focal, self.center, self.k1
        return result


@dataclass(frozen=True)
class PriorWeights:
    """Gaussian that stands for the prior near a solution.

    Attributes:
        width: of the errors of each group of parameters, relative to the prior, (5,).
        information: of each parameter, (V, 11).
    """

    width: Floats
    information: Floats

    @classmethod
    def wide(cls, prior: Prior, views: int) -> PriorWeights:
        """Return the start: all cameras may be far off, so that none is taken to be right."""
        width = np.array([_WIDE if group in _SHARED else 1.0 for group in GROUPS])
        scale = np.empty(PARAMETERS)
        for number, group in enumerate(GROUPS):
            scale[group] = width[number] * prior.sigmas()[group]
        return cls(width, np.tile(scale**-2, (views, 1)))

    def cost(self, parameters: Floats) -> float:
        """Return half the squared standardised parameters, (V, 11)."""
        return 0.5 * float((self.information * parameters**2).sum())

    def updated(self, prior: Prior, parameters: Floats, variances: Floats, free: Bools) -> PriorWeights:
        """Return the weights for errors that were found.

        A Student variable is a normal one of unknown precision; this is a step of expectation maximisation of the
        precision of each camera and of the width (Lange, Little & Taylor, JASA 1989). The errors are known up to their
        variances, which count as well: directions that the data leave open do not pretend that the cameras are right.

        Args:
            prior: expected errors.
            parameters: errors that were found, (V, 11).
            variances: their variances, (V, 11).
            free: which of them may change, (V, 11).
        """
        width, information = self.width.copy(), np.empty_like(parameters)
        square = (parameters**2 + variances) * free / prior.sigmas() ** 2
        for number, group in enumerate(GROUPS):
            count, total = free[:, group].sum(axis=1), square[:, group].sum(axis=1)
            precision = (_FREEDOM + count) / (_FREEDOM + total / width[number] ** 2)
            if group in _SHARED:
                width[number] = np.sqrt((_BELIEF + precision @ total) / (_BELIEF + count.sum()))
            information[:, group] = (precision / width[number] ** 2)[:, None]
        return PriorWeights(width, information / prior.sigmas() ** 2)
