"""Appearance and geometry together (paper, section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numba import njit

from mvpose.affinity.appearance import AppearanceAffinity, apart, cosines, likeness
from mvpose.affinity.base import Floats
from mvpose.affinity.epipolar import EpipolarAffinity
from mvpose.affinity.geometry import GeometricAffinity
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.rays import Rays

Rule = Literal["evidence", "mean"]


@dataclass(frozen=True)
class FusedAffinity:
    """Affinity from appearance and geometry where geometry allows a match, else 0.

    By the rule ``"mean"`` it is the paper's geometric mean of both, sqrt(A_a A_g) if D_g <= th. That gives appearance
    half the say, whatever it can tell: who looks unlike from two sides is lost at any distance between rays, and where
    people wear one uniform all affinities rise towards 1, so that geometry parts them no more.

    By the rule ``"evidence"`` geometry's odds, A_g / (1 - A_g), are multiplied by those of appearance,
    exp(weight (r - d) / slope): d is the distance of the two descriptors, r that of a rival. A rival of i against j is
    whoever stands beside i in i's picture, so surely is another person; the one most like j counts. Where a rival is as
    like as i is, appearance cannot tell who is who and says nothing. What distance is much thus depends on who is
    there, not on a scale for all scenes. Only where nobody stands beside i the scale decides: exp((midpoint - d) /
    slope), the odds of the sigmoid. That is one side; the other is j against i, and the evidence is the geometric mean
    of both.

    Geometry alone decides for a pair where either detection has no descriptor, and for everybody where the
    detections carry none.

    Attributes:
        appearance: compares descriptors.
        geometry: compares poses, and is 0 beyond its threshold.
        rule: how they are combined.
        weight: of evidence against rivals; unused by the mean. Below 1, for that compares two distances, each as
            noisy as the one that the sigmoid was fitted to, and one bad crop spoils all pairs of its detection at once.
            On simulated rings of 3 to 6 cameras anything from 0.25 to 0.35 was as good.

    Raises:
        ValueError: an unknown rule, or a weight that is negative or not finite.
    """

    appearance: AppearanceAffinity = AppearanceAffinity()
    geometry: GeometricAffinity | EpipolarAffinity = GeometricAffinity()
    rule: Rule = "evidence"
    weight: float = 0.3

    def __post_init__(self) -> None:
        if self.rule not in get_args(Rule):
            raise ValueError(f"rule must be 'evidence' or 'mean', got {self.rule!r}")
        if not 0.0 <= self.weight < math.inf:
            raise ValueError(f"weight must be a finite number, 0 or more, got {self.weight}")

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`."""
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
    """Turn geometric affinities into fused ones, in place: a second matrix would cost more than what it holds."""
    m = len(affinity)
    for i in range(m):
        for k in range(i + 1, m):
            if affinity[i, k] > 0.0 and described[i] and described[k]:
                appearance = likeness(cosine[i, k], midpoint, slope)
                affinity[i, k] = affinity[k, i] = math.sqrt(appearance * affinity[i, k])


@njit(cache=True)
def _weigh(affinity, cosine, described, view, midpoint, slope, weight):
    """As :func:`_average`, by evidence."""
    m = len(affinity)
    views = 0
    for i in range(m):
        views = max(views, view[i] + 1)
    nobody = -2.0  # less than any cosine
    first, second = np.empty(views), np.empty(views)  # of each view, the greatest cosine to k, and the next
    nearest = np.full(views, -1)
    side = np.empty((m, m))  # [i, k]: how much nearer k is to i than to a rival of i, as it counts
    for k in range(m):
        first[:], second[:], nearest[:] = nobody, nobody, -1
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
                distance = apart(cosine[i, k])
                side[i, k] = weight * (apart(c) - distance) if c > nobody else midpoint - distance
    for i in range(m):
        for k in range(i + 1, m):
            geometric = affinity[i, k]
            if geometric > 0.0 and described[i] and described[k]:
                against = (1.0 - geometric) * math.exp(-0.5 * (side[i, k] + side[k, i]) / slope)
                affinity[i, k] = affinity[k, i] = geometric / (geometric + against)
