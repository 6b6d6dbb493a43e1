"""Estimation pipeline for one frame: affinity, matching, reconstruction."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mvpose.affinity import Affinity, FusedAffinity
from mvpose.arrays import Bools, Floats, Integers
from mvpose.camera import Rig
from mvpose.checks import seal
from mvpose.detections import Detections
from mvpose.duplicates import Duplicates
from mvpose.estimate import Estimate, Matching
from mvpose.matching import Matcher
from mvpose.ordering import number_views, restored_pairs
from mvpose.rays import Rays, ordered_rays
from mvpose.reconstruction import PictorialStructure, Poses, UnmatchedPictorialStructure
from mvpose.skeleton import Skeleton


@dataclass(frozen=True)
class Pipeline:
    """Multi-person 3D pose estimation from the detections of a few calibrated cameras (Dong et al., CVPR 2019).

    Every stage gets the detections in the canonical order (:mod:`mvpose.ordering`), without blank ones and repeats, so
    that the people and their order depend neither on the order of detections and cameras nor on the world frame.
    """

    affinity: Affinity = FusedAffinity()
    """Affinity between detections, that is, the likelihood that two detections show one person."""
    matching: Callable[[Floats, Integers], Matching] = Matcher()
    """Function from affinities (m, m) and views (m,) to people, over all views at once. Views are numbered in the order
    of their first detections."""
    reconstruction: Callable[[Rays, Integers, Skeleton], Poses] = PictorialStructure()
    """Function from the rays of all detections, labels (m,) and the skeleton to 3D poses."""
    duplicates: Callable[[Detections], Bools] = Duplicates()
    """Function that returns a mask (m,) of the detections to keep; the others repeat a more confident detection of
    their view."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame.

        Args:
            rig: calibrated cameras.
            detections: 2D poses of all views; ``detections.view`` indexes the cameras of the rig.

        Returns:
            The people on whom at least two views agree, possibly none.

        Raises:
            ValueError: a detection in a view that the rig does not have, or detections without descriptors where
                appearance is the only affinity.
        """
        start = time.perf_counter()
        chosen, ordered, rays = prepare_rays(rig, detections, self.duplicates)
        affinity = self.affinity(rig, ordered, rays)
        compared = time.perf_counter()
        matching = self.matching(affinity, number_views(ordered.view))
        matched = time.perf_counter()
        poses = self.reconstruction(rays, matching.labels, detections.skeleton)
        return _estimate(poses, _restored(matching, chosen, len(detections)), start, compared, matched)


@dataclass(frozen=True)
class UnmatchedPipeline:
    """Estimation without matching (the paper's "No matching"): the pictorial structure also groups the detections."""

    reconstruction: Callable[[Rays, Skeleton], tuple[Poses, Integers]] = UnmatchedPictorialStructure()
    """Function from the rays of all detections and the skeleton to 3D poses and labels."""
    duplicates: Callable[[Detections], Bools] = Duplicates()
    """As in :class:`Pipeline`."""

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Estimate the people of one frame; see :meth:`Pipeline.estimate`. Only reconstruction takes time."""
        start = time.perf_counter()
        chosen, _, rays = prepare_rays(rig, detections, self.duplicates)
        ready = time.perf_counter()
        poses, labels = self.reconstruction(rays, detections.skeleton)
        return _estimate(poses, _restored(Matching(labels), chosen, len(detections)), start, ready, ready)


def prepare_rays(
    rig: Rig, detections: Detections, duplicates: Callable[[Detections], Bools]
) -> tuple[Integers, Detections, Rays]:
    """Return the indices of the detections that take part, in canonical order, and their detections and rays.

    Blank and repeated detections are left out before any other stage, so that they cannot influence it.
    """
    order, rays = ordered_rays(rig, detections)
    ordered = detections.select(order)
    kept = duplicates(ordered)
    if np.count_nonzero(kept) < len(kept):
        return order[kept], ordered.select(kept), rays.select(kept)
    return order, ordered, rays


def _restored(matching: Matching, chosen: Integers, detections: int) -> Matching:
    """Return a matching of the chosen detections as one of all detections, in their given order."""
    labels = np.full(detections, -1)
    labels[chosen] = matching.labels
    seal(labels)
    P = None if matching.P is None else restored_pairs(matching.P, chosen, detections)
    return Matching(labels, P, matching.iterations, matching.residuals, matching.objective, matching.converged)


def _without_empty(poses: Poses, matching: Matching) -> tuple[Poses, Matching]:
    """Leave out people without a joint: looks alone may match detections that have no joint in common."""
    placed = ~np.isnan(poses.joints[..., 0]).all(axis=1)
    if placed.all():
        return poses, matching
    number = np.append(np.where(placed, np.cumsum(placed) - 1, -1), -1)
    kept = Poses(*(each[placed] for each in poses))
    return kept, replace(matching, labels=number[matching.labels])


def _estimate(poses: Poses, matching: Matching, start: float, compared: float, matched: float) -> Estimate:
    poses, matching = _without_empty(poses, matching)
    seal(*poses)
    end = time.perf_counter()
    timings = {
        "affinity": compared - start,
        "matching": matched - compared,
        "reconstruction": end - matched,
        "total": end - start,
    }
    return Estimate(poses.joints, poses.scores, matching, poses.covariance, timings, poses.freedom)
