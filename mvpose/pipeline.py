"""The whole method for one frame: affinity, matching, reconstruction."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from mvpose.affinity import GeometricAffinity
from mvpose.camera import Rig
from mvpose.detections import Detections
from mvpose.estimate import Estimate
from mvpose.matching import Matcher
from mvpose.rays import Rays, viewing_rays
from mvpose.reconstruction import PictorialStructure, Triangulation
from mvpose.skeleton import Skeleton

Floats = NDArray[np.float64]
Reconstruction = Callable[[Rays, Skeleton], tuple[Floats, Floats, Floats]]

PRESETS: dict[str, str] = {
    "full": "every cue there is (geometry; appearance where descriptors are given), ADMM matching, 3DPS",
    "fast": "geometry, matching by clustering, robust triangulation",
    "no-3dps": "as full, with robust triangulation in place of the pictorial structure",
}


@dataclass(frozen=True)
class Pipeline:
    """Multi-person 3D pose from the detections of a few calibrated cameras (Dong et al., CVPR 2019).

    Attributes:
        affinity: how likely two detections are one person.
        matching: who is who, over all views at once.
        reconstruction: one person's rays to joints.
    """

    affinity: GeometricAffinity = GeometricAffinity()
    matching: Matcher = Matcher()
    reconstruction: Reconstruction = PictorialStructure()

    @classmethod
    def preset(cls, name: str) -> Self:
        """One of the named variants, :data:`PRESETS`.

        Raises:
            ValueError: a name that is none of them.
        """
        if name not in PRESETS:
            raise ValueError(f"no preset {name!r} of the pipeline; there are {', '.join(PRESETS)}")
        full = cls()
        if name == "fast":
            return replace(full, matching=Matcher(method="clustering"), reconstruction=Triangulation())
        return replace(full, reconstruction=Triangulation()) if name == "no-3dps" else full

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Find the people of one frame.

        Args:
            rig: the cameras, as calibrated.
            detections: the 2D poses of all views; ``detections.view`` counts the rig's cameras.

        Returns:
            The people that at least two views agree on, possibly none.

        Raises:
            ValueError: detections that name a camera that the rig does not have.
        """
        with _threads().limit(limits=1):  # the matrices are small: threads would only fight over them
            clock = [time.perf_counter()]
            rays = viewing_rays(rig, detections)
            affinity = self.affinity(rays)
            clock.append(time.perf_counter())
            matching = self.matching(affinity, detections.view)
            clock.append(time.perf_counter())
            count = len(detections.skeleton)
            joints, scores = np.zeros((matching.people, count, 3)), np.zeros((matching.people, count))
            covariance = np.zeros((matching.people, count, 3, 3))
            for person in range(matching.people):
                mine = matching.labels == person
                joints[person], scores[person], covariance[person] = self.reconstruction(
                    rays.select(mine), detections.skeleton
                )
            clock.append(time.perf_counter())
        stages = dict(zip(("affinity", "matching", "reconstruction"), np.diff(clock).tolist(), strict=True))
        timings = {**stages, "total": clock[-1] - clock[0]}
        return Estimate(joints, scores, matching, covariance, timings)


@cache
def _threads() -> ThreadpoolController:
    return ThreadpoolController()
