"""Scatter of good keypoints: parts that views share, that near joints share, that last, and that are new each frame.

The parts are shares of one variance, so that the distribution of each keypoint does not depend on them.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mvpose import COCO17
from mvpose.arrays import Floats
from simharness.detector.draws import Key, KeyedDraws
from simharness.detector.viewing_conditions import VISIBLE
from simharness.scenario.sections.detector_section import CorrelationSection, KeypointsSection
from simharness.types.truth import GOOD_BELOW


@dataclass(frozen=True)
class Scatter:
    """Scatter of the keypoints of a sequence, drawn for one person after the other."""

    config: KeypointsSection
    """Deviations of good keypoints."""
    correlation: CorrelationSection
    """Shares of the variance, and how long they last."""
    draws: KeyedDraws
    """Draws of the sequence."""

    def of_person(self, person: int, occlusion: NDArray[np.int8], axes: Floats) -> Floats:
        """Return the displacements of a person's keypoints, (T, V, 17, 2) units: Gaussian, truncated at 1.14.

        Args:
            person: index of the person.
            occlusion: occlusion classes of the person's joints, (T, V, 17).
            axes: right and down in the pictures as directions in the world, (T, V, 2, 3).
        """
        near = _near_joints(self.correlation.scatter_near)
        return self.of_joints(person, np.arange(len(BONES_APART)), occlusion, axes, near=near)

    def of_joints(
        self,
        key: Key,
        joints: NDArray[np.int64],
        occlusion: NDArray[np.int8],
        axes: Floats,
        *,
        near: Floats | None = None,
    ) -> Floats:
        """Return the displacements of J joints of a person, (T, V, J, 2) units: Gaussian, truncated at 1.14.

        Args:
            key: name of the joints and of the person.
            joints: joints of COCO-17 whose deviations they have, (J,).
            occlusion: occlusion classes of the joints, (T, V, J).
            axes: right and down in the pictures as directions in the world, (T, V, 2, 3).
            near: factor (J, J) that correlates the joints of one picture; None: independent joints.
        """
        sigma = np.array(self.config.scatter.by_joint())[joints]
        if not sigma.any():
            return np.zeros((*occlusion.shape, 2))
        hidden = np.array(self.config.scatter_hidden.by_joint())[joints]
        sigma = np.where(occlusion == VISIBLE, sigma, hidden * sigma)
        return _truncated(self._normal(key, occlusion.shape, axes, near), np.maximum(sigma, 1e-9))

    def _normal(self, person: Key, shape: tuple[int, ...], axes: Floats, near: Floats | None) -> Floats:
        """Return standard normal displacements, (T, V, J, 2)."""
        correlation = self.correlation
        single = 1 - correlation.scatter_views
        normal = np.zeros((*shape, 2))
        if single > 0:
            for view in range(shape[1]):
                drawn = self._drawn(person, "view", view, shape=(shape[2], 2))
                normal[:, view] = np.sqrt(single) * (drawn if near is None else near @ drawn)
        if correlation.scatter_views > 0:
            space = self._drawn(person, "all", shape=(shape[2], 3))
            normal += np.sqrt(correlation.scatter_views) * (space[:, None] @ np.swapaxes(axes, -1, -2))
        return normal

    def _drawn(self, *key: Key, shape: tuple[int, ...]) -> Floats:
        """Draw standard normal numbers that last, but for the share that is new in every frame, ``(T, *shape)``."""
        life, noise = self.correlation.scatter_life, self.correlation.scatter_noise
        lasting = self.draws.autoregressive("scatter", *key, shape=shape, life=life)
        if noise == 0:
            return lasting
        return np.sqrt(1 - noise) * lasting + np.sqrt(noise) * self.draws.normal("scatter", *key, "anew", shape=shape)


@cache
def _near_joints(correlation: float) -> Floats | None:
    """Return the factor (17, 17) by which independent joints get a correlation that falls along the skeleton.

    The correlation of joints that are n bones apart is the n-th power of the given one. None: independent joints.
    """
    if correlation == 0:
        return None
    return np.asarray(np.linalg.cholesky(correlation**BONES_APART + 1e-9 * np.eye(len(BONES_APART))), float)


def _bones_apart() -> NDArray[np.int64]:
    """Return the number of bones between two joints of COCO-17 along the tree of its skeleton, (17, 17)."""
    parents = COCO17.parents
    paths = []
    for joint in range(len(parents)):
        path = [joint]
        while parents[path[-1]] >= 0:
            path.append(parents[path[-1]])
        paths.append(path)
    return np.array([[len(set(one) ^ set(other)) for other in paths] for one in paths])


BONES_APART = _bones_apart()
"""Number of bones between two joints of COCO-17, (17, 17)."""


def _truncated(normal: Floats, sigma: Floats) -> Floats:
    """Return standard normal displacements (..., 17, 2) with the deviations sigma (..., 17), truncated at 1.14.

    The radius keeps its rank when its distribution is truncated: radius² / 2 is exponential.
    """
    square = (normal**2).sum(axis=-1)
    whole = -np.expm1(-0.5 * (GOOD_BELOW / sigma) ** 2)
    radius = sigma * np.sqrt(-2 * np.log1p(np.expm1(-0.5 * square) * whole))
    return normal * np.divide(radius, np.sqrt(square), out=np.zeros_like(square), where=square > 0)[..., None]
