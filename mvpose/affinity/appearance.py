"""Affinity from appearance: descriptors of a person re-identification network."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mvpose.affinity.base import FASTMATH, Floats, scalar_sigmoid
from mvpose.camera import Rig
from mvpose.checks import check_numbers
from mvpose.detections import Detections
from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.threads import one_thread


@dataclass(frozen=True)
class AppearanceAffinity:
    """Affinity from the Euclidean distance between descriptors, each scaled to unit length.

    The paper (section 3.2) maps the distance by a sigmoid and does not state its scale. The released code derives it
    from the spread of the current matrix, so a scene without contrast, for example with one person, has no matches.
    Here the scale is absolute. The distance of unit vectors at cosine c is sqrt(2 - 2 c): 0.77 to 0.45 for the same
    person (cosine 0.7 to 0.9), and 1.41 for different people, who are nearly orthogonal in a space of many dimensions.
    It is 1.1 or more for different people where similar clothes, or a rectifier as the last layer of the network, give
    a cosine of 0.4.

    Raises:
        ValueError: ``midpoint`` or ``slope`` not above 0.
    """

    midpoint: float = 1.0
    """Distance at affinity 1/2; the default of 1 is a cosine of 1/2."""
    slope: float = 0.1
    """Distance over which the affinity falls from 1/2 to 1/(1 + e). At 0.1 the same person gets 0.9 or more, different
    people 0.27 or less, orthogonal descriptors 0.02."""

    def __post_init__(self) -> None:
        check_numbers(self, "the appearance affinity", positive=("midpoint", "slope"))

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Return the affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`.

        The affinity of a detection without a descriptor is 0.

        Raises:
            ValueError: detections without descriptors.
        """
        if detections.descriptors is None and len(detections):
            raise ValueError(
                f"appearance affinity needs descriptors (m, D), but the {len(detections)} detections carry none: "
                "give Detections(descriptors=...), with a row of NaN where a detection has none, or use geometry alone"
            )
        cosine, described = cosines(detections)
        return _cross_view_affinity(cosine, detections.view, described, self.midpoint, self.slope)


def cosines(detections: Detections) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return cosines between descriptors, (m, m), and a mask of detections with a finite nonzero descriptor, (m,)."""
    descriptors = detections.descriptors
    if descriptors is None:
        descriptors = np.zeros((len(detections), 0))
    unit, described = _unit(descriptors)
    with one_thread():
        return unit @ unit.T, described


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _unit(descriptors):
    m, dimensions = descriptors.shape
    unit = np.zeros((m, dimensions), np.float32)  # seven digits suffice, at half the cost
    described = np.zeros(m, np.bool_)
    for i in range(m):
        square = 0.0
        for k in range(dimensions):
            square += descriptors[i, k] * descriptors[i, k]
        described[i] = 0.0 < square < np.inf  # false for NaN
        if described[i]:
            scale = 1.0 / math.sqrt(square)
            for k in range(dimensions):
                unit[i, k] = descriptors[i, k] * scale
    return unit, described


@njit(cache=True)
def cosine_affinity(cosine, midpoint, slope):
    """Return the affinity of two unit vectors from their cosine."""
    return scalar_sigmoid(cosine_distance(cosine), midpoint, slope)


@njit(cache=True)
def cosine_distance(cosine):
    """Return the distance of two unit vectors from their cosine."""
    return math.sqrt(max(2.0 - 2.0 * cosine, 0.0))


@njit(cache=True)
def _cross_view_affinity(cosine, view, described, midpoint, slope):
    m = len(view)
    result = np.zeros((m, m))
    for i in range(m):
        for k in range(i + 1, m):
            if view[i] != view[k] and described[i] and described[k]:
                result[i, k] = result[k, i] = cosine_affinity(cosine[i, k], midpoint, slope)
    return result
