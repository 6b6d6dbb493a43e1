"""Affinity between tracks and detections: the predicted people enter the matching as one more view.

A track and a detection are compared as two detections are (:mod:`mvpose.affinity.geometry`): by the mean distance
between the predicted joints and the viewing rays, mapped by a sigmoid. Distances shrink by the uncertainty of the
prediction, so any detection lies near a track that is known only roughly. The normalisation of its Gaussian makes up
for it where several tracks claim one detection: a lost person does not take the detections of one who is there. The
matrix of all detections and tracks goes through the same matching, so that cycle consistency holds between the views
and the past (Zhang et al., "4D Association Graph", CVPR 2020, and the journal version of the paper use predicted
people alike).

Settings of a tracker.
"""

from dataclasses import dataclass

import numpy as np

from mvpose.affinity.base import scalar_sigmoid
from mvpose.arrays import Floats, Integers
from mvpose.checks import check_numbers
from mvpose.kernels import njit
from mvpose.rays import Rays
from mvpose.reconstruction.likelihood import Noise
from mvpose.tracking.drift_watch import DriftModel
from mvpose.tracking.existence import Existence
from mvpose.tracking.motion import MotionModel
from mvpose.tracking.reappearance import Reappearance


@dataclass(frozen=True)
class TrackAffinity:
    """Affinity from the mean distance between predicted joints and viewing rays."""

    midpoint: float = 0.15
    """Distance at affinity 1/2, metres."""
    slope: float = 0.04
    """Distance over which the affinity falls from 1/2 to 1/(1 + e), metres."""
    threshold: float = 0.25
    """Distance beyond which the affinity is 0, metres."""
    saturation: float = 0.5
    """Greatest distance that one joint contributes, metres."""
    keypoint: float = 0.1
    """Standard deviation of a keypoint across its ray, metres: predicted joints that are less certain than that count
    less."""
    least_joints: int = 3
    """Least number of joints that both have."""

    def __post_init__(self) -> None:
        check_numbers(
            self,
            "the affinity of tracks",
            positive=("midpoint", "slope", "keypoint"),
            limits=("threshold", "saturation"),
        )

    def join(
        self, affinity: Floats, view: Integers, rays: Rays, state: Floats, covariance: Floats, lead: Floats
    ) -> tuple[Floats, Integers]:
        """Return affinities (m + n, m + n) and views (m + n,) of m detections followed by n tracks.

        Args:
            affinity: affinities of the detections, (m, m).
            view: their views, (m,).
            rays: their viewing rays.
            state: predicted positions and velocities, (n, J, 6).
            covariance: their covariances, (n, J, 6, 6).
            lead: time from the states to the picture of each detection, (m,), seconds.
        """
        settings = self.midpoint, self.slope, self.threshold, self.saturation, self.keypoint, self.least_joints
        return _join(affinity, view, rays.origins, rays.directions, rays.weights, state, covariance, lead, settings)


@njit(cache=True)
def _join(affinity, view, origins, directions, weights, state, covariance, lead, settings):
    midpoint, slope, threshold, saturation, keypoint, least = settings
    m, n, joints = len(view), len(state), weights.shape[1]
    joined, views = np.zeros((m + n, m + n)), np.empty(m + n, np.int64)
    joined[:m, :m] = affinity
    last = -1
    for d in range(m):
        views[d] = view[d]
        last = max(last, view[d])
    cost, vagueness = np.empty(n), np.empty(n)
    known = np.empty((n, joints, 3))  # of each joint: certainty, its root and its logarithm
    for t in range(n):
        views[m + t] = last + 1
        for j in range(joints):
            spread = 0.0
            for r in range(3):
                spread += covariance[t, j, r, r]
            certainty = keypoint * keypoint / (keypoint * keypoint + spread / 3.0)
            known[t, j, 0], known[t, j, 1], known[t, j, 2] = certainty, np.sqrt(certainty), np.log(certainty)
    for d in range(m):
        least_vague = np.inf
        for t in range(n):
            total, vague, mass, count = 0.0, 0.0, 0.0, 0
            for j in range(joints):
                if not (weights[d, j] > 0.0) or np.isnan(state[t, j, 0]):
                    continue
                along, square = 0.0, 0.0
                for r in range(3):
                    offset = state[t, j, r] + lead[d] * state[t, j, 3 + r] - origins[d, r]
                    along += offset * directions[d, j, r]
                    square += offset * offset
                distance = np.sqrt(max(square - along * along, 0.0)) if along > 0.0 else np.sqrt(square)
                weight = weights[d, j] * known[t, j, 0]  # a joint known only roughly says less about who this is
                total += weight * min(distance * known[t, j, 1], saturation)
                vague -= weight * known[t, j, 2]
                mass += weight
                count += 1
            cost[t] = total / mass if count >= least else np.inf
            vagueness[t] = vague / mass if count >= least else np.inf
            if cost[t] <= threshold:
                least_vague = min(least_vague, vagueness[t])
        for t in range(n):
            if cost[t] <= threshold:
                more = min(slope * (vagueness[t] - least_vague), 0.5 * midpoint)
                joined[m + t, d] = joined[d, m + t] = scalar_sigmoid(cost[t] + more, midpoint, slope)
    return joined, views


@dataclass(frozen=True)
class TrackingModel:
    """Settings of a tracker."""

    motion: MotionModel = MotionModel()
    """Motion of joints."""
    affinity: TrackAffinity = TrackAffinity()
    """Affinity between tracks and detections."""
    existence: Existence = Existence()
    """How often people come, and how often people and ghosts are found."""
    reappearance: Reappearance = Reappearance()
    """How people who were lost come back."""
    noise: Noise = Noise()
    """Error model of keypoints."""
    drift: DriftModel = DriftModel()
    """Watch over the cameras."""
    correlation: float = 0.15
    """Time over which the errors of poses are correlated, seconds: wrong keypoints last 0.2 to 0.3 s, others change
    faster."""
    period: float = 0.04
    """Time between frames whose detections carry no time, seconds."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.correlation < np.inf:
            raise ValueError(f"correlation must be 0 s or more and finite, got {self.correlation}")
        if not 0.0 < self.period < np.inf:
            raise ValueError(f"period must be above 0 s and finite, got {self.period}")
