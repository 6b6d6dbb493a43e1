"""Appearance and geometry together (paper, section 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from numba import njit

from mvpose.affinity.appearance import AppearanceAffinity, cosines, likeness
from mvpose.affinity.base import Floats
from mvpose.affinity.epipolar import EpipolarAffinity
from mvpose.affinity.geometry import GeometricAffinity
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.rays import Rays


@dataclass(frozen=True)
class FusedAffinity:
    """The geometric mean of both affinities where geometry allows a match, else 0: sqrt(A_a A_g) if D_g <= th.

    Geometry alone decides for a pair where either detection has no descriptor, and for everybody where the
    detections carry none.

    Attributes:
        appearance: compares descriptors.
        geometry: compares poses, and is 0 beyond its threshold.
    """

    appearance: AppearanceAffinity = AppearanceAffinity()
    geometry: GeometricAffinity | EpipolarAffinity = GeometricAffinity()

    def __call__(self, rig: Rig, detections: Detections, rays: Rays) -> Floats:
        """Affinity matrix, (m, m); see :class:`mvpose.affinity.Affinity`."""
        affinity = self.geometry(rig, detections, rays)
        if detections.descriptors is not None:
            cosine, described = cosines(detections)
            _fuse(affinity, cosine, described, self.appearance.midpoint, self.appearance.slope)
        return affinity


@njit(cache=True)
def _fuse(affinity, cosine, described, midpoint, slope):  # type: ignore[no-untyped-def]
    """Turn geometric affinities into fused ones, in place: a second matrix would cost more than what it holds."""
    m = len(affinity)
    for i in range(m):
        for k in range(i + 1, m):
            if affinity[i, k] > 0.0 and described[i] and described[k]:
                appearance = likeness(cosine[i, k], midpoint, slope)
                affinity[i, k] = affinity[k, i] = math.sqrt(appearance * affinity[i, k])
