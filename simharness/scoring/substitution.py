"""Substitutes for stages of the method: perfect detections and true labels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mvpose import Detections, Estimate, Pipeline, Rig, Skeleton
from mvpose.arrays import Integers
from mvpose.estimate import Matching
from mvpose.estimators import Estimator
from mvpose.pipeline import UnmatchedPipeline
from mvpose.rays import Rays, viewing_rays
from mvpose.reconstruction import Poses
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility


def perfect_detections(detections: Detections, truth: Truth) -> tuple[Detections, Truth]:
    """Return the perfect detections of a frame and the truth of these detections.

    Every person with a joint inside a picture is detected there, with the joints inside at their exact pixels, hidden
    or not, as by the detector profile "perfect"; there are no other detections. Scores are 1; there are no heat maps.
    A detection has the descriptor of the real detection of the same person in the same view (if several, of the one
    with the highest box score). Without a real detection the descriptor is NaN: geometry can still match such a
    detection, a method that uses descriptors alone cannot.

    Args:
        detections: the real detections.
        truth: truth of the frame and of the real detections.
    """
    inside = truth.visibility != Visibility.OUTSIDE
    view, person = np.nonzero(inside.any(axis=-1))
    reported = inside[view, person]
    descriptors = None
    if detections.descriptors is not None:
        real = _highest_scored(detections, truth)[view, person]
        descriptors = np.full((len(view), detections.descriptors.shape[1]), np.nan)
        descriptors[real >= 0] = detections.descriptors[real[real >= 0]]
    perfect = Detections(
        view,
        np.where(reported[..., None], truth.pixels[view, person], np.nan),
        reported.astype(float),
        truth.boxes[view, person],
        np.ones(len(view)),
        detections.skeleton,
        descriptors,
    )
    error = np.where(reported, KeypointError.GOOD, KeypointError.ABSENT)
    return perfect, replace(truth, person=person, error=error)


def true_labels(detections: Detections, truth: Truth) -> Integers:
    """Return the labels of a perfect matching of m detections, (m,): people detected in two or more views, from 0.

    Of several detections of a person in one view, the one with the highest score has the label. The others, phantoms,
    and people detected in a single view have label -1.
    """
    highest = _highest_scored(detections, truth)
    detected = highest >= 0
    detected &= detected.sum(axis=0) > 1
    labels = np.full(len(detections), -1)
    number = np.cumsum(detected.any(axis=0)) - 1
    labels[highest[detected]] = np.broadcast_to(number, detected.shape)[detected]
    return labels


@dataclass(frozen=True)
class LabelledPipeline:
    """Pipeline with given labels in place of affinity and matching.

    Attributes:
        labels: label of each detection of its input, (m,).
        reconstruction: as in :class:`mvpose.Pipeline`.
    """

    labels: Integers
    reconstruction: Callable[[Rays, Integers, Skeleton], Poses]

    def estimate(self, rig: Rig, detections: Detections) -> Estimate:
        """Reconstruct the labelled people of one frame."""
        poses = self.reconstruction(viewing_rays(rig, detections), self.labels, detections.skeleton)
        return Estimate(poses.joints, poses.scores, Matching(self.labels), poses.covariance)


def with_labels(estimator: Estimator, labels: Integers) -> LabelledPipeline | None:
    """Return a pipeline with given labels in place of its matching; None for a method whose stages are unknown.

    A pipeline without matching assigns detections during reconstruction, so it is replaced by the preset "full" (3D
    pictorial structures) with the given labels.

    Args:
        estimator: the method.
        labels: label of each detection of its input, (m,).
    """
    estimator = getattr(estimator, "loaded", estimator)  # a user-defined estimator may be a pipeline
    if isinstance(estimator, UnmatchedPipeline):
        estimator = Pipeline()
    if not isinstance(estimator, Pipeline):
        return None
    return LabelledPipeline(labels, estimator.reconstruction)


def _highest_scored(detections: Detections, truth: Truth) -> Integers:
    """Return the detection of each person in each view with the highest box score, (V, P); -1 where there is none.

    Ties are broken by the mean keypoint score, then by the order of the detections.
    """
    highest = np.full(truth.boxes.shape[:2], -1)
    ascending = np.lexsort((-np.arange(len(detections)), detections.scores.sum(axis=1), detections.box_scores))
    ascending = ascending[truth.person[ascending] >= 0]
    highest[detections.view[ascending], truth.person[ascending]] = ascending  # the last of repeated indices stays
    return highest
