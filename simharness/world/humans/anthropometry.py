"""Published body measures of adults and children, from which the population is drawn.

Adults: ANSUR II, Gordon et al., "2012 Anthropometric Survey of U.S. Army Personnel: Methods and Summary Statistics",
NATICK/TR-15/007, 2014, 4082 men and 1986 women. ANSUR measures lengths between landmarks on bones; the body model
measures between joint centres. Thighs (trochanterion to lateral femoral epicondyle), knee heights (epicondyle) and
forearms (radiale to stylion) are used unchanged, because those landmarks are level with the joints within a
centimetre. The shoulder joint lies 10.4 % of the length from acromion to radiale below the acromion, and the elbow
joint 4.3 % above the radiale (de Leva, "Joint center longitudinal positions computed from a selected subset of
Chandler's data", J. Biomechanics 29, 1996). The mean body mass index is mean weight over mean stature squared; its
deviation is that of weight at a given stature.

Children: WHO growth reference for 5 to 19 years, de Onis et al., Bulletin of the WHO 85, 2007.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

_UPPER_ARM = 1 - 0.104 - 0.043  # shoulder joint to elbow joint, as a fraction of acromion to radiale


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation and correlation with stature of a body measure."""

    mean: float
    deviation: float
    correlation: float = 0.0


# Correlations with stature are rounded from ANSUR (Cheverud et al., NATICK/TR-90/031, 1990), between 0.6 and 0.9;
# those of differences of two heights are lower.
ADULTS: Mapping[str, Mapping[str, Spread]] = MappingProxyType(
    {
        "male": {
            "stature": Spread(1.756, 0.0686, 1.0),
            "bmi": Spread(27.7, 4.0),
            "upper_arm": Spread(0.3352 * _UPPER_ARM, 0.0175 * _UPPER_ARM, 0.75),
            "forearm": Spread(0.2679, 0.0154, 0.75),
            "thigh": Spread(0.4093, 0.0284, 0.65),
            "knee": Spread(0.4917, 0.0266, 0.85),
        },
        "female": {
            "stature": Spread(1.6285, 0.0642, 1.0),
            "bmi": Spread(25.5, 3.6),
            "upper_arm": Spread(0.3112 * _UPPER_ARM, 0.0172 * _UPPER_ARM, 0.75),
            "forearm": Spread(0.2413, 0.0152, 0.75),
            "thigh": Spread(0.3794, 0.0240, 0.65),
            "knee": Spread(0.4659, 0.0271, 0.85),
        },
    }
)
"""Measures of adults by sex, in metres, bmi in kg/m2. "knee" is the height of the knee joint over the sole."""

YEARS = (5.0, 12.0)
"""Least and greatest age of children, years."""
_KNOTS = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0)  # years
# LMS parameters at the knots. Stature: median in metres and coefficient of variation S (the power L is 1).
# Body mass index: L, median in kg/m2, S.
_STATURE = {
    "male": (
        (1.0973, 1.1595, 1.2173, 1.2727, 1.3257, 1.3778, 1.4311, 1.4908),
        (0.0416, 0.0425, 0.0434, 0.0444, 0.0454, 0.0463, 0.0470, 0.0475),
    ),
    "female": (
        (1.0907, 1.1512, 1.2081, 1.2656, 1.3249, 1.3864, 1.4499, 1.5123),
        (0.0435, 0.0445, 0.0453, 0.0458, 0.0461, 0.0461, 0.0458, 0.0452),
    ),
}
_MASS_INDEX = {
    "male": (
        (-0.72, -0.99, -1.25, -1.46, -1.63, -1.74, -1.79, -1.78),
        (15.27, 15.31, 15.48, 15.74, 16.05, 16.44, 16.94, 17.53),
        (0.084, 0.087, 0.091, 0.095, 0.100, 0.106, 0.111, 0.115),
    ),
    "female": (
        (-0.87, -1.08, -1.26, -1.39, -1.47, -1.49, -1.46, -1.40),
        (15.25, 15.27, 15.40, 15.68, 16.10, 16.61, 17.25, 18.00),
        (0.096, 0.102, 0.107, 0.113, 0.118, 0.123, 0.127, 0.131),
    ),
}


def child_stature(sex: str, years: float) -> Spread:
    """Return the distribution of stature of children: ``sex`` "male" or "female", age 5 to 12 years."""
    median, variation = (float(np.interp(years, _KNOTS, row)) for row in _STATURE[sex])
    return Spread(median, median * variation, 1.0)


def child_mass_index(sex: str, years: float, score: float) -> float:
    """Return the body mass index, kg/m2, at ``score`` standard deviations from the median of a sex and age."""
    power, median, variation = (float(np.interp(years, _KNOTS, row)) for row in _MASS_INDEX[sex])
    return float(median * (1 + power * variation * score) ** (1 / power))
