"""The whole method for one frame: affinity, matching, reconstruction."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mvpose.affinity import Affinity, AppearanceAffinity, FusedAffinity, GeometricAffinity
from mvpose.camera import Rig
from mvpose.checks import seal
from mvpose.detections import Detections
from mvpose.duplicates import Duplicates
from mvpose.estimate import Estimate, Matching
from mvpose.matching import Matcher
from mvpose.rays import Rays, viewing_rays
from mvpose.reconstruction import PictorialStructure, Poses, Triangulation, UnmatchedPictorialStructure
from mvpose.skeleton import Skeleton

PRESETS: dict[str, str] = {
    "full": "every cue there is (geometry; appearance where descriptors are given), ADMM matching, 3DPS",
    "appearance": "as full, with appearance as the only affinity: detections must carry descriptors",
    "geometry": "as full, with geometry as the only affinity",
    "hungarian": "as full, with matching of two views at a time: nothing makes the pairs agree",
    "no-3dps": "as full, with robust triangulation in place of the pictorial structure",
    "no-matching": "3DPS straight from all detections",
    "fast": "as full, with matching by clustering and robust triangulation",
}

NEED_DESCRIPTORS = frozenset({"appearance"})
"""The presets that have nothing to go by where detections carry no descriptors."""

READ_HEATMAPS = frozenset({"full", "appearance", "geometry", "hungarian"})
"""The presets that make use of heat maps where detections carry them; the others go by keypoints."""


class Estimator(Protocol):
    """Anything that finds the people of a frame."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Find the people of one frame; see :meth:`Pipeline.estimate`."""
        ...


@dataclass(frozen=True)
class Pipeline:
    """Multi-person 3D pose from the detections of a few calibrated cameras (Dong et al., CVPR 2019).

    Attributes:
        affinity: how likely two detections are one person.
        matching: affinities (m, m) and views (m,) to people, over all views at once.
        reconstruction: everybody's rays, labels (m,) and the skeleton to joints.
        duplicates: which detections to keep, (m,); the others repeat a surer one of their view.
    """

    affinity: Affinity = FusedAffinity()
    matching: Callable[[NDArray[np.float64], NDArray[np.int64]], Matching] = Matcher()
    reconstruction: Callable[[Rays, NDArray[np.int64], Skeleton], Poses] = PictorialStructure()
    duplicates: Callable[[Detections], NDArray[np.bool_]] = Duplicates()

    @staticmethod
    def preset(name: str, *, appearance: AppearanceAffinity | None = None) -> Estimator:
        """One of the named variants, :data:`PRESETS`: the rows of the paper's ablation, and a fast one.

        Args:
            name: of the variant.
            appearance: what distances of descriptors mean; of a network ``ReId.affinity`` says it. By default what they
                mean in general.

        Raises:
            ValueError: a name that is none of them.
        """
        appearance = appearance or AppearanceAffinity()
        full = Pipeline(affinity=FusedAffinity(appearance=appearance))
        variants: dict[str, Estimator] = {
            "full": full,
            "appearance": replace(full, affinity=appearance),
            "geometry": replace(full, affinity=GeometricAffinity()),
            "hungarian": replace(full, matching=Matcher(method="hungarian")),
            "no-3dps": replace(full, reconstruction=Triangulation()),
            "no-matching": UnmatchedPipeline(),
            "fast": replace(full, matching=Matcher(method="clustering"), reconstruction=Triangulation()),
        }
        if name not in variants:
            raise ValueError(f"no preset {name!r} of the pipeline; there are {', '.join(PRESETS)}")
        return variants[name]

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Find the people of one frame.

        Args:
            rig: the cameras, as calibrated.
            detections: the 2D poses of all views; ``detections.view`` counts the rig's cameras.

        Returns:
            The people that at least two views agree on, possibly none.

        Raises:
            ValueError: detections that name a camera that the rig does not have, or that lack descriptors where
                appearance is the only affinity.
        """
        start = time.perf_counter()
        rays = viewing_rays(rig, detections)
        affinity = self.affinity(rig, detections, rays)
        kept = self.duplicates(detections)
        if not kept.all():
            affinity[~kept] = affinity[:, ~kept] = 0.0
        compared = time.perf_counter()
        matching = self.matching(affinity, detections.view)
        matched = time.perf_counter()
        poses = self.reconstruction(rays, matching.labels, detections.skeleton)
        return _estimate(poses, matching, start, compared, matched)


@dataclass(frozen=True)
class UnmatchedPipeline:
    """The paper's "No matching": pictorial structures say by themselves who is who.

    Attributes:
        reconstruction: everybody's rays and the skeleton to joints and labels.
        duplicates: as of :class:`Pipeline`.
    """

    reconstruction: Callable[[Rays, Skeleton], tuple[Poses, NDArray[np.int64]]] = UnmatchedPictorialStructure()
    duplicates: Callable[[Detections], NDArray[np.bool_]] = Duplicates()

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Find the people of one frame; see :meth:`Pipeline.estimate`. Only reconstruction takes time."""
        start = time.perf_counter()
        rays = viewing_rays(rig, detections)
        rays.weights[~self.duplicates(detections)] = 0.0  # who sees nothing belongs to nobody
        ready = time.perf_counter()
        poses, labels = self.reconstruction(rays, detections.skeleton)
        return _estimate(poses, Matching(labels), start, ready, ready)


def _estimate(poses: Poses, matching: Matching, start: float, compared: float, matched: float) -> Estimate:
    seal(*poses)
    end = time.perf_counter()
    timings = {
        "affinity": compared - start,
        "matching": matched - compared,
        "reconstruction": end - matched,
        "total": end - start,
    }
    return Estimate(poses.joints, poses.scores, matching, poses.covariance, timings)
