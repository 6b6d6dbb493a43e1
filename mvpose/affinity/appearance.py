"""Affinity from what people look like: descriptors of a person re-identification network."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mvpose.affinity.base import FASTMATH, Floats, falling
from mvpose.camera import Rig
from mvpose.checks import check_numbers
from mvpose.detections import Detections
from mvpose.rays import Rays
from mvpose.threads import one_thread


@dataclass(frozen=True)
class AppearanceAffinity:
    """Affinity from the Euclidean distance of two detections' descriptors, each scaled to unit length.

    The paper (section 3.2) maps the distance by a sigmoid and leaves its scale open; the released code takes it from
    the spread of the matrix at hand, so that a scene without contrast, as with one person, has no matches. Here it is
    absolute. Unit vectors at cosine c are sqrt(2 - 2 c) apart: the same person (0.7 to 0.9) 0.77 to 0.45, and
    strangers, who are near a right angle in a space of many dimensions, 1.41, or 1.1 and more where their common
    clothes or a rectifier at the network's end bring them to a cosine of 0.4.

    Attributes:
        midpoint: distance at which a match is as likely as not (affinity 1/2): 1, a cosine of 1/2.
        slope: distance over which the affinity falls from 1/2 to 1/(1 + e). At 0.1 the same person gets 0.9 and more,
            strangers 0.27 and less, at a right angle 0.02.

    Raises:
        ValueError: a scale that is not above 0.
    """

    midpoint: float = 1.0
    slope: float = 0.1

    def __post_init__(self) -> None:
        check_numbers(self, "the appearance affinity", positive=("midpoint", "slope"))

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`. 0 for a detection without a descriptor.

        Raises:
            ValueError: the detections carry no descriptors.
        """
        if detections.descriptors is None and len(detections):
            raise ValueError(
                f"appearance affinity needs descriptors (m, D), but the {len(detections)} detections carry none: "
                "give Detections(descriptors=...), with a row of NaN where a detection has none, or use geometry alone"
            )
        cosine, described = cosines(detections)
        return _across_views(cosine, detections.view, described, self.midpoint, self.slope)


def cosines(detections: Detections) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Cosines between descriptors, (m, m), and which detections have one, (m,): numbers, not all 0."""
    descriptors = detections.descriptors
    if descriptors is None:
        descriptors = np.zeros((len(detections), 0))
    unit, described = _unit(descriptors)
    with one_thread():
        return unit @ unit.T, described


@njit(cache=True, fastmath=FASTMATH, error_model="numpy")
def _unit(descriptors):
    m, dimensions = descriptors.shape
    unit = np.zeros((m, dimensions), np.float32)  # seven digits are plenty, and half the work
    described = np.zeros(m, np.bool_)
    for i in range(m):
        square = 0.0
        for k in range(dimensions):
            square += descriptors[i, k] * descriptors[i, k]
        described[i] = 0.0 < square < np.inf  # false of NaN
        if described[i]:
            scale = 1.0 / math.sqrt(square)
            for k in range(dimensions):
                unit[i, k] = descriptors[i, k] * scale
    return unit, described


@njit(cache=True)
def likeness(cosine, midpoint, slope):
    """Affinity of two unit vectors."""
    return falling(apart(cosine), midpoint, slope)


@njit(cache=True)
def apart(cosine):
    """Distance of two unit vectors."""
    return math.sqrt(max(2.0 - 2.0 * cosine, 0.0))


@njit(cache=True)
def _across_views(cosine, view, described, midpoint, slope):
    m = len(view)
    result = np.zeros((m, m))
    for i in range(m):
        for k in range(i + 1, m):
            if view[i] != view[k] and described[i] and described[k]:
                result[i, k] = result[k, i] = likeness(cosine[i, k], midpoint, slope)
    return result
