"""Prior on the errors of the believed cameras: heavy tails, and a width that the cameras share.

The data do not fix the place, the orientation and the size of the whole rig; the prior does. The errors of each camera
have a Student distribution: where most cameras agree with each other, they keep their places, and one that was moved
takes the whole correction, as in a least sum of distances; where all cameras are off, the correction is spread over
them, as by least squares. The width of the distribution is estimated with the cameras (empirical Bayes), so that
intervals are narrow where the other cameras prove to be right.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri, stdtrit

from mvpose.arrays import Bools, Floats
from mvpose.calibration.normal_equations import CENTER, CLOCK, FOCAL, K1, PARAMETERS, POSE, ROTATION, TRANSLATION

_TOGETHER = (POSE, CLOCK, FOCAL, CENTER, K1)  # parameters of a camera that are off together
_ESTIMATED = (ROTATION, TRANSLATION, CLOCK)  # groups of parameters whose width is estimated
_FREEDOM = 4.0  # of the Student distribution of each camera's errors
_BELIEF = 1.0  # numbers that the expected width is worth: rigs range from boards to measuring tapes
_WIDE = 10.0  # width in the first step: 2 degrees, 0.2 m


@dataclass(frozen=True)
class Prior:
    """Errors of a careful calibration: standard deviations of the body of the distribution, whose tails are heavy.

    Rotations and positions after calibration with a board are off by 0.2 degrees and 5 to 19 mm, focal lengths by 0.3
    to 1.3 % (caliscope).
    """

    rotation: float = float(np.radians(0.2))
    """Radians."""
    translation: float = 0.02
    """Metres."""
    clock: float = 0.01
    """Seconds."""
    focal: float = 0.005
    """Relative."""
    center: float = 5.0
    """Pixels."""
    k1: float = 0.02
    """Of the lens."""

    def sigmas(self) -> Floats:
        """Return the standard deviation of each parameter of a camera, (11,)."""
        result = np.empty(PARAMETERS)
        result[ROTATION], result[TRANSLATION], result[CLOCK] = self.rotation, self.translation, self.clock
        result[FOCAL], result[CENTER], result[K1] = self.focal, self.center, self.k1
        return result


@dataclass(frozen=True)
class PriorWeights:
    """Gaussian that stands for the prior near a solution."""

    width: Floats
    """Of the errors, relative to the prior, (11,)."""
    information: Floats
    """Of each parameter, (V, 11)."""

    @classmethod
    def wide(cls, prior: Prior, views: int) -> "PriorWeights":
        """Return the start: all cameras may be far off, so that none is taken to be right."""
        width = np.ones(PARAMETERS)
        for group in _ESTIMATED:
            width[group] = _WIDE
        return cls(width, np.tile((width * prior.sigmas()) ** -2, (views, 1)))

    def cost(self, parameters: Floats) -> float:
        """Return half the squared standardised parameters, (V, 11)."""
        return 0.5 * float((self.information * parameters**2).sum())

    def updated(self, prior: Prior, parameters: Floats, variances: Floats, free: Bools) -> "PriorWeights":
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
        square = (parameters**2 + variances) * free / prior.sigmas() ** 2
        precision, width = np.empty_like(parameters), self.width.copy()
        for group in _TOGETHER:
            total = (square[:, group] / self.width[group] ** 2).sum(axis=1)
            precision[:, group] = ((_FREEDOM + free[:, group].sum(axis=1)) / (_FREEDOM + total))[:, None]
        for group in _ESTIMATED:
            total = (precision * square)[:, group].sum()
            width[group] = np.sqrt((_BELIEF + total) / (_BELIEF + free[:, group].sum()))
        return PriorWeights(width, precision / (width * prior.sigmas()) ** 2)

    def widened(self, variances: Floats, free: Bools) -> "PriorWeights":
        """Return the weights for intervals: the widths are estimates from few cameras.

        A normal variable whose variance was estimated from n numbers has a Student distribution with n degrees of
        freedom. The prior gets the standard deviation of the normal distribution with the same 90 % interval. Numbers
        that the data determine count, each by its share ``1 - variance / prior variance`` (MacKay, "Bayesian
        Interpolation", 1992).

        Args:
            variances: of the errors, given the weights, (V, 11).
            free: which parameters may change, (V, 11).
        """
        determined = np.clip(1.0 - variances * self.information, 0.0, 1.0) * free
        information = self.information.copy()
        for group in _ESTIMATED:
            count = _BELIEF + determined[:, group].sum()
            information[:, group] *= (ndtri(0.95) / stdtrit(count, 0.95)) ** 2
        return PriorWeights(self.width, information)
