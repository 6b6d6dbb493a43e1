"""The truth put in for a stage of the method: what a perfect detector reports, and who is who."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mvpose import Detections, Pipeline, Rig
from mvpose.arrays import Floats, Integers
from mvpose.estimate import Matching
from mvpose.pipeline import Estimator, UnmatchedPipeline
from mvpose.rays import Rays
from simharness.types.truth import KeypointError, Truth
from simharness.types.views import Visibility


def perfect_detections(detections: Detections, truth: Truth) -> tuple[Detections, Truth]:
    """What a perfect detector reports of the pictures of a frame, and the truth about that.

    Everybody who has a joint in a picture is found in it, with those joints exactly where they are in that picture,
    hidden or not, as the profile "perfect" finds them; nobody else is. Scores are 1 and there are no heat maps. A
    detection has the descriptor of the real one of the same person and view, of the surest if there are several; NaN,
    that is none, where there is no real one: geometry places such a one, and a method that uses descriptors alone
    cannot.

    Args:
        detections: the real ones.
        truth: about them.
    """
    inside = truth.visibility != Visibility.OUTSIDE
    view, person = np.nonzero(inside.any(axis=-1))
    reported = inside[view, person]
    descriptors = None
    if detections.descriptors is not None:
        real = _surest(detections, truth)[view, person]
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
    """What a perfect matching says of m detections, (m,): the people who are found in two views or more, from 0.

    Of several detections of one person in one view the surest is the person's. The others, phantoms, and people whom
    a single view finds, are -1.
    """
    surest = _surest(detections, truth)
    found = surest >= 0
    found &= found.sum(axis=0) > 1
    labels = np.full(len(detections), -1)
    number = np.cumsum(found.any(axis=0)) - 1
    labels[surest[found]] = np.broadcast_to(number, found.shape)[found]
    return labels


def with_labels(estimator: Estimator, labels: Integers) -> Pipeline | None:
    """A method that is told who is who, and does the rest by itself; None for one whose stages are not known.

    One that goes without matching does by itself what it is told here, so its place is taken by matching and
    pictorial structure, as in the preset "full".

    Args:
        estimator: the method.
        labels: person of each detection that it will get, (m,).
    """
    estimator = getattr(estimator, "loaded", estimator)  # a user-defined estimator may be a pipeline
    if isinstance(estimator, UnmatchedPipeline):
        estimator = Pipeline()
    if not isinstance(estimator, Pipeline):
        return None
    return replace(estimator, affinity=_unasked, matching=_Told(labels))


class _Told:
    """A matching that needs no affinities."""

    def __init__(self, labels: Integers) -> None:
        self._labels = labels

    def __call__(self, affinity: Floats, view: Integers) -> Matching:
        return Matching(self._labels)


def _unasked(rig: Rig, detections: Detections, rays: Rays) -> Floats:
    return np.zeros((len(detections), len(detections)))


def _surest(detections: Detections, truth: Truth) -> Integers:
    """The detection of each person in each view with the greatest box score (of equals, the greatest mean score, then
    the first), (V, P); -1 where there is none.
    """
    surest = np.full(truth.boxes.shape[:2], -1)
    rising = np.lexsort((-np.arange(len(detections)), detections.scores.sum(axis=1), detections.box_scores))
    rising = rising[truth.person[rising] >= 0]
    surest[detections.view[rising], truth.person[rising]] = rising  # of repeated places the last stays
    return surest
