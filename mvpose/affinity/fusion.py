"""Affinity from appearance and geometry combined (paper, section 3.2)."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from mvpose.affinity.appearance import AppearanceAffinity, cosine_affinity, cosine_distance, cosines
from mvpose.affinity.base import Floats
from mvpose.affinity.epipolar import EpipolarAffinity
from mvpose.affinity.geometry import GeometricAffinity
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.kernels import njit
from mvpose.rays import Rays

Rule = Literal["evidence", "mean"]


@dataclass(frozen=True)
class FusedAffinity:
    """Affinity from appearance and geometry where geometry allows a match, else 0.

    The rule ``"mean"`` is the geometric mean of the paper, sqrt(A_a A_g) if D_g <= th. It gives appearance half the
    weight regardless of how informative it is: a person who looks different from two sides is lost at any
    distance between the rays, and where people wear one uniform all affinities rise towards 1, so geometry no longer
    separates them.

    The rule ``"evidence"`` multiplies the odds of geometry, A_g / (1 - A_g), by those of appearance,
    exp(weight (r - d) / slope), where d is the distance of the two descriptors and r that of a rival. The rivals of i
    against j are the other detections in the view of i, which show other people; the rival most similar to j counts.
    Where a rival is as similar to j as i is, appearance has no information and the factor is 1. So the distance that
    counts as large depends on the people present, not on a scale for all scenes. The scale decides only where i has
    no rival: the factor is then exp((midpoint - d) / slope), the odds of the sigmoid. The same holds for j against i,
    and the evidence is the geometric mean of both directions.

    Geometry alone decides for a pair where either detection has no descriptor, and for all pairs where the detections
    carry no descriptors.

    Raises:
        ValueError: an unknown rule, or a weight that is negative or not finite.
    """

    appearance: AppearanceAffinity = AppearanceAffinity()
    """Affinity from descriptors."""
    geometry: GeometricAffinity | EpipolarAffinity = GeometricAffinity()
    """Affinity from poses, 0 beyond its threshold."""
    rule: Rule = "evidence"
    """Rule of combination."""
    weight: float = 0.3
    """Weight of the evidence against rivals; unused by the mean. It is below 1 because this evidence compares two
    distances, each as noisy as the one that the sigmoid was fitted to, and because one bad crop affects all pairs of
    its detection at once. On simulated rings of 3 to 6 cameras all values from 0.25 to 0.35 were equally good."""

    def __post_init__(self) -> None:
        if self.rule not in get_args(Rule):
            raise ValueError(f"rule must be 'evidence' or 'mean', got {self.rule!r}")
        if not 0.0 <= self.weight < math.inf:
            raise ValueError(f"weight must be a finite number, 0 or more, got {self.weight}")

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Return the affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`."""
        affinity = self.geometry(rig, detections, rays)
        if detections.descriptors is not None:
            cosine, described = cosines(detections)
            midpoint, slope = self.appearance.midpoint, self.appearance.slope
            if self.rule == "mean":
                _average(affinity, cosine, described, midpoint, slope)
            else:
                _weigh(affinity, cosine, described, detections.view, midpoint, slope, self.weight)
        return affinity


@njit(cache=True)
def _average(affinity, cosine, described, midpoint, slope):
    """Replace geometric affinities by fused ones, in place because a second matrix would dominate the cost."""
    m = len(affinity)
    for i in range(m):
        for k in range(i + 1, m):
            if affinity[i, k] > 0.0 and described[i] and described[k]:
                appearance = cosine_affinity(cosine[i, k], midpoint, slope)
                affinity[i, k] = affinity[k, i] = math.sqrt(appearance * affinity[i, k])


@njit(cache=True)
def _weigh(affinity, cosine, described, view, midpoint, slope, weight):
    """Replace geometric affinities by those of the rule "evidence", in place."""
    m = len(affinity)
    views = 0
    for i in range(m):
        views = max(views, view[i] + 1)
    no_rival = -2.0  # below any cosine
    first, second = np.empty(views), np.empty(views)  # greatest and second greatest cosine to k in each view
    nearest = np.full(views, -1)
    side = np.empty((m, m))  # [i, k]: weighted difference of the distances of k to the rival of i and to i
    for k in range(m):
        first[:], second[:], nearest[:] = no_rival, no_rival, -1
        for i in range(m):
            v, c = view[i], cosine[i, k]
            if not described[i]:
                continue
            if c > first[v]:
                first[v], second[v], nearest[v] = c, first[v], i
            elif c > second[v]:
                second[v] = c
        for i in range(m):
            if affinity[i, k] > 0.0:
                c = second[view[i]] if nearest[view[i]] == i else first[view[i]]
                distance = cosine_distance(cosine[i, k])
                side[i, k] = weight * (cosine_distance(c) - distance) if c > no_rival else midpoint - distance
    for i in range(m):
        for k in range(i + 1, m):
            geometric = affinity[i, k]
            if geometric > 0.0 and described[i] and described[k]:
                against = (1.0 - geometric) * math.exp(-0.5 * (side[i, k] + side[k, i]) / slope)
                affinity[i, k] = affinity[k, i] = geometric / (geometric + against)
